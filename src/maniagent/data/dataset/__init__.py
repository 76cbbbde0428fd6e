"""LeRobotDataset v3 as files: reading, verifying, summing up and drawing them without LeRobot itself.

The format: https://huggingface.co/docs/lerobot/lerobot-dataset-v3. Read from any maker; nothing here writes a dataset.
"""
