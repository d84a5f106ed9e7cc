"""Takes one figure out of a report as a file of its own: `figure.py RUN/report.html LABEL > docs/NAME.svg`.

LABEL is the figure's `aria-label`, such as `calibrated simulation against measurements`.
"""

import re
import sys

page = open(sys.argv[1], encoding="utf-8").read()
style = page[page.index("<style>") + 7 : page.index("</style>")]
start = page.rindex("<svg", 0, page.index(f'aria-label="{sys.argv[2]}"'))

# The figure holds panels that are `svg` elements themselves.
depth, end = 0, start
for tag in re.finditer(r"<svg\b|</svg>", page[start:]):
    depth += 1 if tag.group() == "<svg" else -1
    if depth == 0:
        end = start + tag.end()
        break
figure = page[start:end]

values = dict(re.findall(r"(--[\w-]+):\s*([^;]+);", style))
drawings = style[style.index("/* Drawings */") + 14 : style.index("@media print")]
used = {name for names in re.findall(r'class="([^"]*)"', figure) for name in names.split()}
rules = []
for selectors, body in re.findall(r"([^{}]+)\{([^{}]*)\}", drawings):
    kept = [s.strip() for s in selectors.split(",") if set(re.findall(r"\.([\w-]+)", s)) <= used]
    kept = [s for s in kept if not s.startswith(("#", ".key"))]
    if kept:
        body = re.sub(r"var\((--[\w-]+)\)", lambda m: values[m.group(1)], body.strip())
        rules.append(f"{', '.join(kept)} {{ {body} }}")
head, rest = figure.split(">", 1)
background = '<rect width="100%" height="100%" fill="#ffffff"/>'
print(f"{head}><style>\n" + "\n".join(rules) + f"\n</style>{background}{rest}")
