"""The thesis's §5.3: is every pulse that the drone logs received on the ground?"""
