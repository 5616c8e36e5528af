"""Type stubs for installed interface packages, made from their classes (C9.2).

`loading` finds the classes, `fields` says what a field is to a type checker, `modules` writes the
text of a stub file, and `folders` puts the files where checkers look. Nothing here needs rclpy, or
the compiled type support of a package.
"""
