"""Commands of the command line, one in each module."""

GROUPS = {
    "Tap tests": {
        "demo": "Simulate 24 months of tap tests on an ageing spindle, and write a report.",
        "init": "Create a machine folder with a commented machine.toml.",
        "doctor": "Check this computer for tap tests: ports, permissions, clock, disk, packages, browser.",
        "ports": "List serial ports and the DAQs that answer.",
        "sensors": "Check hammer, accelerometer and DAQ.",
        "tap": "Run a live tap test: ten good hits, then the result.",
    },
    "Cutting programs": {
        "recommend": "Recommend spindle speed and axial depth for a tool and a material.",
        "check": "Check cutting programs against the newest tap tests.",
        "report": "Write an HTML report of a machine or a fleet.",
        "lobes": "Show stability lobes and stable pockets, compared with the first tap tests.",
        "pitch": "Propose unequal pitches for a cutter at one spindle speed.",
        "materials": "List materials with cutting-force coefficients, ranges and sources.",
    },
    "Spindle condition": {
        "trend": "Show the trend of f1 and a forecast for each program.",
        "ack": "Acknowledge alarms.",
        "event": "Record maintenance of a machine, such as new bearings.",
        "exclude": "Exclude a tap test or a test cut from all results.",
        "include": "Include an excluded tap test or test cut again.",
    },
    "Test cuts": {
        "listen": "Record a cut with the accelerometer on the housing and detect chatter.",
        "observe": "Record whether a cut sounded stable, or its power.",
        "suggest": "Suggest the next test cut of a program.",
    },
    "Archive": {
        "replay": "Store recorded files as tap tests, each file once.",
        "history": "List tap tests, test cuts and events of a machine, oldest first.",
        "verify": "Find damaged, missing or changed files of a machine folder.",
        "rebuild": "Rebuild the history and a damaged journal. No file is deleted.",
    },
    "Fleet": {
        "status": "Show the status of all machines, worst first.",
        "serve": "Serve the dashboard of all machines in a browser.",
        "export": "Export the tap tests of all machines as one table.",
    },
    "Single steps": {
        "modes": "Fit natural frequency, damping ratio and stiffness of a recording or a stored tap test.",
        "shapes": "Show mode shapes from tool to column, and the share of each part in 1/K at the tip.",
        "convert": "Convert a recorded file to UFF, CSV, MATLAB or SEP005.",
        "model": "Show the spindle model: modes, stiffness, critical speed.",
        "calibrate": "Fit bearing and joint stiffness to measured natural frequencies.",
        "paper": "Compare lobewatch with the paper of Gaber & Hashemi (2015).",
        "emulate": "Emulate a DAQ on a pseudo-terminal or a TCP port.",
        "bridge": "Serve a DAQ as a TAPS/1 device on TCP.",
    },
}
"""Commands by topic, each with the first line of its help. Listing them imports none."""
COMMANDS = {name: summary for commands in GROUPS.values() for name, summary in commands.items()}
"""First line of the help of each command."""
