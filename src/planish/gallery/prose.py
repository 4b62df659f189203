"""Text of the test pages. OCR baselines and tests depend on it, so its wording stays."""

HEAD = "On paper that will not lie flat"

TITLE = "How a bent page becomes flat again"

STORY = (
    "A sheet of paper bends readily and stretches hardly at all. Pull at it with both hands and it will tear before "
    "it grows by three parts in a hundred; press it into a valley and it gives way at once, along a straight line. "
    "That is why a bent page keeps a secret that a bent sheet of rubber has lost: every distance measured along its "
    "surface is still the distance that the printer set, and the flat page can be found again from the curved one.",
    "# What the camera sees",
    "Lay a thick book open under a camera and look at the picture. Close to the spine the lines of print climb, crowd "
    "together and sink into shade; towards the outer edge they drop away and run small. Nothing has happened to the "
    "words. The paper stands at an angle to the lens, so that less of it faces us, and at an angle to the lamp, so "
    "that less light falls on it. Both effects come from one cause, and whoever knows the shape can undo both.",
    "For a long time the shape was guessed from the print itself. Lines of text ought to be straight, letters ought "
    "to stand upright, margins ought to be parallel. On a page of plain prose the guess is often good. On a map, a "
    "letter with three words, a page of music or a sheet that was folded into a pocket there is nothing to guess "
    "from, and the method falls silent just where the reader needs it most.",
    "# What the scanner measures",
    "A range scanner does not guess. It throws a stripe of light across the sheet, watches from one side how the "
    "stripe is bent, and works out the distance of each point by simple geometry. Some hundred thousand points are "
    "gathered within a few seconds. Each carries a small error, perhaps the width of a hair, and each belongs to a "
    "known place in the photograph that was taken with it.",
    "Join each point to its neighbours and the sheet becomes a net. The threads of the net have the lengths that were "
    "measured on the real paper, and the task can be put in one sentence: lay the net on the table without changing "
    "the length of any thread. Small errors of the scanner make every thread a little too long, since a path that "
    "trembles is longer than a path that does not, and so the errors must be smoothed away before the net is laid "
    "down, gently, lest a true crease be taken for a tremble and rounded off.",
    "# Letting the sheet fall",
    "One way to lay it down is to let it fall. Give every point a weight, let gravity pull it, stop it at the table, "
    "and after every short moment put right the threads that have grown or shrunk. The net sinks, slides outward, "
    "rests. It is a simulation that a child could describe, and it seldom goes wrong, for at no time is the paper "
    "asked to do what real paper would refuse. Its only fault is that a large net needs a great many moments before "
    "word of what happens at one edge has come through to the other.",
    "Another way is to ask directly for the flat net whose threads are nearest to their measured lengths. The question "
    "leads to a large system of equations, and large systems yield to an old device: solve the problem first on a "
    "coarse grid, where it is small, and carry the answer down to the fine grid, where only the details are missing. "
    "Done with care, the answer for every single point arrives sooner than the eye can follow.",
    "# Taking away the shade",
    "A flat page that keeps its old shadows looks bent still. The eye reads light as form, and no amount of geometry "
    "will persuade it otherwise. But the shape that served to flatten the sheet also tells how steeply each patch of "
    "it was turned from the lamp. Fit one lamp and a little light from all around to the blank parts of the paper, "
    "divide it out, and the page turns even from edge to edge while the ink stays black and the pictures keep "
    "their tones.",
    "What remains is honesty. A scan has holes; an overhang hides what lies below; print seen from a grazing angle "
    "is blurred and no program can bring it back. A good restoration marks such places rather than painting over "
    "them, states how large the page is and by how much it may be wrong, and leaves the reader to judge. The sheet "
    "of paper has kept its measure through years of damp and careless hands. The least we can do is to keep it too.",
    "# A word on old paper",
    "Paper made from rags before the age of the machine is often in better health than paper made from wood a hundred "
    "years ago. The later sheets turned brown and brittle, and a page that breaks when it is turned cannot be pressed "
    "under glass. It must be copied as it lies. The same is true of bindings so tight that they open only to the "
    "width of two fingers, of charters with heavy seals, and of letters that were burnt at one edge.",
    "For such things the distance between the lens and the sheet is a mercy. Nothing touches the object; it may rest "
    "in a cradle, in cool light, for as long as a scan takes. What is afterwards turned, smoothed and lit anew is a "
    "picture, which bears any treatment. The more we are able to do to the picture, the less need be done to the "
    "thing, and that is the whole of the craft.",
    "Those who keep archives have a second wish. They would like the copy to be true to size, so that a hand can be "
    "compared with a hand and a watermark with a watermark across the shelves of distant libraries. A photograph "
    "alone has no scale. A scan has one, since every point of it is a place in the room, and the flat page that is "
    "made from it can be laid on the original and will match it from corner to corner.",
)
"""Paragraphs, and headings that begin with #."""

TABLE = (
    ("Kind of paper", "Grams", "Millimetres"),
    ("Tissue for repairs", "9", "0.03"),
    ("Paper for newspapers", "45", "0.07"),
    ("Paper for writing", "80", "0.10"),
    ("Paper for drawing", "180", "0.24"),
    ("Board for covers", "400", "0.60"),
)

DRAWING_CAPTION = "Figure 1. A waving sheet. The lines drawn on it have kept their length."

PICTURE_CAPTION = "Plate 2. Hills before sunrise, from a negative on glass."

STAMP = ("LIBRARY", "RECEIVED 14 MAY")

CHART_CAPTION = "Plate 3. Colours and greys, which a restored page should keep."
