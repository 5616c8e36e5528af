"""What no package index has: action servers in C++, and another middleware than Fast DDS.

`prefix()` is the folder that `build` of the project's shared files makes, with `lib` and `include`.
"""
