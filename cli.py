"""Run the command from a checkout: ``python cli.py run maps/office.scenario.yaml``."""

from qualrl.commands.main import main

if __name__ == "__main__":
    main()
