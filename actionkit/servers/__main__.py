"""``python -m actionkit.servers NAME``: run one reference server until SIGINT or SIGTERM."""

from actionkit.servers._serving.child import main

if __name__ == "__main__":
    main()
