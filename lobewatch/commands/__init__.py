"""Commands of the command line, one in each module."""

GROUPS = {
    "Tap (measure a spindle)": {
        "demo": "A simulated spindle ages over 24 months, tapped in x and y; a forecast beside the truth, a report.",
        "init": "Make a machine folder with a commented machine.toml: ten questions, or their answers as options.",
        "doctor": "What of this computer stands in the way of a tap test: ports, rights, clock, disk, packages, "
        "browser.",
        "ports": "Serial ports, and which DAQ answers there.",
        "sensors": "Hammer, accelerometer and DAQ: what they are, and whether they are right.",
        "tap": "The live tap test: hit until ten hits are good, then see what has changed.",
    },
    "Judge (which cuts are safe)": {
        "recommend": "A speed and a depth for a tool and a material, no program needed; exit code 1 where none "
        "is safe.",
        "check": "Every cutting program against the newest tap tests of its tool; exit code 1 unless all are stable.",
        "report": "One HTML file with everything in it: what has changed, which programs still hold, lobes then "
        "and now.",
        "lobes": "Stability lobes of the newest tap tests, drawn beside those of the first, and the pockets that "
        "are safe.",
        "pitch": "Unequal pitches for a cutter at one speed: what they gain over equal pitch, or that equal "
        "is as good.",
        "materials": "Materials that machine.toml may name, with their cutting coefficients, ranges and sources.",
    },
    "Decay (how a spindle ages)": {
        "trend": "How the frequency has fallen, whether that is more than scatter, and until when each program holds.",
        "ack": "Acknowledge alarms: they are known. It quiets repeats, never the light.",
        "event": "Write down what was done to a machine; after a repair the following of the mode may begin anew.",
        "exclude": "Take a tap test out of the series: all results are as if it had never been taken.",
        "include": "Take a tap test back into the series that lobewatch exclude has taken out.",
    },
    "Cuts (what test cuts say)": {
        "listen": "Hear a cut with the accelerometer on the housing: stable, chatter and its frequency, or why it "
        "cannot be told.",
        "observe": "Write down what was heard of a test cut by ear: that it was stable, or that it chattered.",
        "suggest": "The next test cut of a program: the one worth most, of those that are more likely stable than not.",
    },
    "Archive (what is kept)": {
        "replay": "Recorded files through the same pipeline as a live test; each is stored once.",
        "history": "All tap tests of a machine with what they say, those excluded, and what was done to it, oldest "
        "first.",
        "verify": "Every byte of a machine folder against what was written; exit code 1 where something is damaged.",
        "rebuild": "The history anew from the tap tests, and the journal where that is damaged; nothing is deleted.",
    },
    "Plant (many machines)": {
        "status": "How all machines of a folder stand, worst first: light, fall, why, what to do next, when to "
        "tap again.",
        "serve": "Machines in a browser, worst first; START begins a tap test on the port that machine.toml "
        "names. Ctrl-C ends it.",
        "export": "All tap tests of all machines as one table for other programs: SQLite, CSV, Parquet, PostgreSQL.",
    },
    "Parts (single steps)": {
        "modes": "Natural frequency, damping ratio and stiffness from one recorded file.",
        "convert": "A recorded file written for other programs: universal file, text table, MATLAB, SEP005.",
        "model": "The spindle model: modes, stiffness, critical speed; with another tool in it, predicted before "
        "it is tapped.",
        "calibrate": "Stiffness of bearings and joints for measured natural frequencies; nothing is stored.",
        "paper": "The numbers and figures of Gaber & Hashemi beside ours, with the reason of each difference.",
        "emulate": "A data acquisition device made of software, on a pseudo-terminal.",
        "bridge": "Any device as a TAPS/1 device on TCP: plugged in here, used by lobewatch on another computer. "
        "Ctrl-C ends it.",
    },
}
"""Commands by topic, each with the first line of its help. Listing them imports none."""
COMMANDS = {name: summary for commands in GROUPS.values() for name, summary in commands.items()}
"""First line of the help of each command."""
