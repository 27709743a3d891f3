"""ScenePlan to Trace: PyBullet in a child process, and the agents that move."""
