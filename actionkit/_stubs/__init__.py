"""Makes type stubs for installed interface packages, from their classes (C9.2).

`loading` finds the classes, `fields` has the types of a field, `modules` writes the text of a file,
and `folders` puts files where checkers look. rclpy and compiled type support are not needed.
"""
