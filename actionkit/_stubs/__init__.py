"""Type stubs for installed interface packages, made from their classes (C9.2).

`loading` finds the classes, `fields` has the types of a field, `modules` the text of a file, and
`folders` puts files where checkers look. It needs no rclpy and no compiled type support.
"""
