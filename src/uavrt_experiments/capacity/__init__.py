"""The thesis's §5.4: how fast may messages be sent through an autopilot?"""
