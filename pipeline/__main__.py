import sys

from pipeline.run.main import main

if __name__ == "__main__":
    sys.exit(main())
