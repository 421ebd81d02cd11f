"""Tests of the pages in a browser: what they show, and how they respond to the user.

Usage: test_pages.py PROGRAM PAGES [--pictures FOLDER]: the program `mechid`, the example `pages`, and a folder for pictures at
four widths. If a user's computer has no browser, a message says so and the tests count as passed; in CI (`CI` is set) that is
an error.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from chromium import Browser, Page, find  # noqa: E402
from samples import hardening_hz, make  # noqa: E402

WIDTHS = (390, 768, 1280, 1920)
PAGES = ("response", "matrix", "shapes", "one", "single", "three", "force", "trends", "nonlinear", "bearing", "decay", "frf",
         "modes", "saved", "backbone")

# Pairs of texts of one figure whose boxes overlap.
OVERLAPS = """
[...document.querySelectorAll('figure > svg')].flatMap(svg => {
    const texts = [...svg.querySelectorAll('text')].filter(t => t.textContent.trim() && t.getBoundingClientRect().width);
    const boxes = texts.map(t => t.getBoundingClientRect());
    const found = [];
    boxes.forEach((a, i) => boxes.forEach((b, j) => {
        const across = Math.min(a.right, b.right) - Math.max(a.left, b.left), down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (i < j && across > 1 && down > 2.5) found.push(texts[i].textContent + ' | ' + texts[j].textContent);
    }));
    return found;
})
"""

# Elements that extend beyond the window, except those inside a scrolling box or a drawing.
BEYOND = """
[...document.querySelectorAll('body *')].filter(e => e.getBoundingClientRect().right > innerWidth + 1
    && !e.closest('.scroll > *, svg *')).map(e => e.tagName + '.' + e.className)
"""

# Number of panels whose ordinate has fewer than two numbers and so shows no scale.
LONELY = """
[...document.querySelectorAll('figure > svg g.panel')].filter(g => g.querySelectorAll('text[text-anchor=end]').length < 2).length
"""

# Panels whose abscissa has only one number, and figures none of whose abscissae has two.
ONE_NUMBER = """
[...document.querySelectorAll('figure > svg')].filter(svg => {
    const counts = [...svg.querySelectorAll('g.panel')].map(g => [...g.querySelectorAll('text[text-anchor=middle][font-size="11.5"]')]
        .filter(t => /^[−0-9.×⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+$/.test(t.textContent)).length);
    return counts.length && (counts.includes(1) || counts.at(-1) === 0);
}).map(svg => svg.closest('figure').id)
"""

# Texts whose contrast is below the limit of WCAG AA: 4.5, or 3 for large text.
FAINT = """
(() => {
    const channel = c => { c /= 255; return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4; };
    const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
    const parse = text => text.match(/[\\d.]+/g)?.map(Number) ?? [0, 0, 0, 0];
    const behind = e => { for (; e; e = e.parentElement) { const c = parse(getComputedStyle(e).backgroundColor); if (c.length < 4 || c[3] > 0.99) return c; }
        return matchMedia('(prefers-color-scheme: dark)').matches ? [18, 18, 18] : [255, 255, 255]; };
    return [...document.querySelectorAll('h1, h2, p, dt, dd, li, th, td, figcaption, button, label, select, a, b, span, svg text')].filter(e => {
        if (!e.textContent.trim() || !e.getBoundingClientRect().width) return false;
        const style = getComputedStyle(e), isSvg = e.namespaceURI.endsWith('svg');
        const paper = isSvg ? parse(getComputedStyle(e.ownerSVGElement.querySelector('rect')).fill) : behind(e);
        const [a, b] = [light(parse(isSvg ? style.fill : style.color)), light(paper)].sort((x, y) => y - x);
        const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.6 && style.fontWeight >= 700);
        return (a + 0.05) / (b + 0.05) < (large ? 3 : 4.5);
    }).map(e => e.tagName + ': ' + e.textContent.slice(0, 40));
})()
"""


def box(page, figure, panel=0):
    """Scroll to a figure; return left, top, right and bottom of the frame of a panel, in px of the window."""
    page.run(f"document.querySelector('{figure}').scrollIntoView()")
    page.settle(4)
    return page.run(
        f"(() => {{ const b = document.querySelectorAll('{figure} .frame')[{panel}].getBoundingClientRect();"
        " return [b.left, b.top, b.right, b.bottom]; })()"
    )


def values(page, figure):
    """Return the names and numbers that the cursor shows."""
    rows = page.run(f"[...document.querySelectorAll('{figure} .values span')].map(s => s.textContent)")
    return [row.replace("−", "-") for row in rows]


def ticks(page, figure):
    return page.run(
        f"[...document.querySelectorAll('{figure} text[text-anchor=middle]')].map(t => t.textContent)"
        ".filter(t => /^[−0-9.]+$/.test(t)).map(t => +t.replace('−', '-'))"
    )


def along(page, figure, value):
    """Return the position (px) of a value on the abscissa, interpolated between the outermost ticks."""
    labels = page.run(
        f"[...document.querySelectorAll('{figure} text[text-anchor=middle]')].map(t => {{ const b = t.getBoundingClientRect();"
        " return [t.textContent, (b.left + b.right) / 2]; })"
    )
    known = [(float(text.replace("−", "-")), x) for text, x in labels if re.fullmatch(r"[−0-9.]+", text)]
    (a, left), (b, right) = min(known), max(known)
    return left + (value - a) / (b - a) * (right - left)


def go_to(page, figure, hz, step):
    """Move the cursor to a spectral line: with the pointer near it, with the keys exactly to it; return what it shows."""
    left, top, right, bottom = box(page, figure)
    page.mouse("mouseMoved", along(page, figure, hz), (top + bottom) / 2)
    seen = " ".join(values(page, figure))
    found = re.search(r"Frequency ([\d.]+) Hz", seen)
    assert found and abs(float(found.group(1)) - hz) <= 5 * step, f"cursor near {hz} Hz shows {seen}"
    steps = round((hz - float(found.group(1))) / step)
    page.run(f"document.querySelector('{figure} svg').focus()")
    for _ in range(abs(steps)):
        name = "ArrowRight" if steps > 0 else "ArrowLeft"
        page.call("Input.dispatchKeyEvent", type="keyDown", key=name)
        page.call("Input.dispatchKeyEvent", type="keyUp", key=name)
    page.settle()
    return values(page, figure)


def path(page, selector):
    return page.run(f"document.querySelector('{selector}').getAttribute('d')")


class Tests:
    def __init__(self, browser, folder, pictures):
        self.browser, self.folder, self.pictures = browser, folder, pictures
        self.failures, self.numbers = [], {}

    def check(self, is_right, what):
        if not is_right:
            self.failures.append(what)
            print("FAILED", what, flush=True)

    def page(self, name, width=1280, **more):
        return Page(self.browser, width, **more).open(self.folder / f"{name}.html")

    def close(self, page, name):
        self.check(page.complaints == [], f"{name}: the console shows {page.complaints[:2]}")
        own = (self.folder / f"{name}.html").resolve().as_uri()
        self.check(set(page.requests) == {own}, f"{name}: the page loads {page.requests}")

    def cursor_and_zoom(self):
        page = self.page("response")
        page.everything()
        expected = json.loads((self.folder / "expected.json").read_text())
        for known in expected:
            seen = go_to(page, "figure", known["hz"], known["step"])
            self.check(any(row.startswith(f"Frequency {known['hz']:g} Hz") for row in seen), f"{seen}")
            row = next((row for row in seen if f"{known['quantity']}, measured" in row), "")
            number = re.search(r"measured ([-\d.e]+)", row)
            value = float(number.group(1)) if number else float("nan")
            # The cursor shows six digits.
            self.check(abs(value / known["magnitude"] - 1) < 6e-6, f"{row} is not {known['magnitude']}")
        left, top, right, bottom = box(page, "figure")
        before = ticks(page, "figure")
        page.drag((left + 0.2 * (right - left), top + 60), (left + 0.3 * (right - left), top + 62))
        after = ticks(page, "figure")
        self.check(max(after[-8:]) < 0.5 * max(before), f"zoom: {before} {after}")
        page.mouse("mousePressed", left + 90, top + 50, button="left", clickCount=2)
        page.mouse("mouseReleased", left + 90, top + 50, button="left", clickCount=2)
        page.run("document.querySelector('.tools button').click()")
        page.settle()
        self.check(ticks(page, "figure") == before, "reset brings the first view back")
        # The second button of the tools switches to panning.
        page.run("document.querySelectorAll('.tools button')[1].click()")
        page.drag((left + 300, top + 50), (left + 200, top + 50))
        self.check(ticks(page, "figure") != before, "panning moves the axis")
        page.run("document.querySelectorAll('.tools button')[1].click(); document.querySelector('.tools button').click()")
        page.settle()
        # The legend hides and shows a curve.
        count = lambda: page.run("document.querySelectorAll('figure .curve').length")
        curves = count()
        page.run("document.querySelector('.keys button').click()")
        page.settle()
        self.check(count() < curves, "the legend hides a curve")
        self.check(page.run("document.querySelector('.keys button').getAttribute('aria-pressed')") == "false", "legend state")
        page.run("document.querySelector('.keys button').click()")
        page.settle()
        self.check(count() == curves, "the legend shows it again")
        # Every entry of every list draws something without an error in the console.
        for at in range(page.run("document.querySelectorAll('.tools select').length")):
            for option in range(page.run(f"document.querySelectorAll('.tools select')[{at}].options.length")):
                page.run(
                    f"(() => {{ const s = document.querySelectorAll('.tools select')[{at}]; s.selectedIndex = {option}; s.onchange(); }})()"
                )
                drawn = page.run("document.querySelectorAll('figure .curve path').length")
                overlaps = page.run(OVERLAPS)
                self.check(drawn > 0 and not overlaps, f"choice {at}.{option}: {drawn} paths, {overlaps[:3]}")
            page.run(f"(() => {{ const s = document.querySelectorAll('.tools select')[{at}]; s.selectedIndex = 0; s.onchange(); }})()")
        self.close(page, "response")

    def quantities(self):
        """The page of responses converts accelerance to receptance: their ratio is (iω)²."""
        page = self.page("response")
        page.everything()
        read = {}
        known = json.loads((self.folder / "expected.json").read_text())[0]
        for order in (2, 0):
            page.run(f"(() => {{ const s = document.querySelectorAll('.tools select')[3]; s.value = {order}; s.onchange(); }})()")
            page.settle()
            text = " ".join(go_to(page, "figure", known["hz"], known["step"]))
            read[order] = float(re.search(r"measured ([-\d.e]+)", text).group(1))
        hz = known["hz"]
        ratio = read[2] / read[0] / (2 * 3.141592653589793 * hz) ** 2
        self.check(abs(ratio - 1) < 2e-5, f"accelerance over receptance at {hz} Hz: {ratio}")

    def matrix(self):
        size = (self.folder / "matrix.html").stat().st_size
        self.numbers["28 × 2 × 4096: bytes"] = size
        self.check(size <= 3_000_000, f"28 × 2 responses take {size} bytes")
        page = self.page("matrix")
        page.settle()
        paint = page.run("performance.getEntriesByType('paint')[0]?.startTime ?? NaN")
        self.check(paint is not None and paint <= 1000, f"28 × 2 responses: first picture after {paint} ms")
        self.numbers["28 × 2 × 4096: first paint, ms"] = paint and round(paint)
        page.everything()
        count = page.run("document.querySelectorAll('.map button').length")
        self.check(count == 56, f"{count} small drawings")
        title = "[...document.querySelectorAll('figure svg text[font-weight=bold]')].map(t => t.textContent)[0]"
        page.run("document.querySelectorAll('.map button')[30].click()")
        page.settle()
        self.check(page.run(title) == "a3 / F2", f"the third of the second row is {page.run(title)}")
        # The time that a frame takes while the pointer moves.
        left, top, right, bottom = box(page, "figure")
        spent = page.run(
            f"""(async () => {{
                const svg = document.querySelector('figure svg'), times = [];
                const frame = () => new Promise(done => requestAnimationFrame(done));
                for (let k = 0; k < 120; k++) {{
                    svg.dispatchEvent(new PointerEvent('pointermove', {{clientX: {left} + 5 + 4 * k, clientY: {(top + bottom) / 2}, bubbles: true}}));
                    const start = performance.now();
                    await frame();
                    times.push(performance.now() - start);
                }}
                times.sort((a, b) => a - b);
                return [times[60], times[114]];
            }})()"""
        )
        self.numbers["cursor: ms a frame, median and 95 %"] = [round(v, 1) for v in spent]
        # At 60 frames per second a frame takes 17 ms; the limit allows for other programs on the computer.
        self.check(spent[0] <= 30, f"cursor: {spent[0]} ms a frame")
        self.close(page, "matrix")

    def shapes(self):
        page = self.page("shapes", reduced=False)
        page.everything()
        page.run("document.querySelector('svg.shape').scrollIntoView()")
        page.settle(4)
        first = path(page, "svg.shape .moved")
        page.run("new Promise(done => setTimeout(done, 400))")
        second = path(page, "svg.shape .moved")
        self.check(first != second, "the animation moves")
        self.check(path(page, "svg.shape .rest") not in (first, second), "the structure at rest is another line")
        pause = "document.querySelector('svg.shape').parentElement.querySelector('.tools button')"
        page.run(f"{pause}.click()")
        page.settle()
        first = path(page, "svg.shape .moved")
        page.run("new Promise(done => setTimeout(done, 200))")
        self.check(path(page, "svg.shape .moved") == first, "the pause stops it")
        page.run("document.querySelectorAll('svg.shape ~ .map button')[2].click()")
        page.settle()
        self.check("55.5 Hz" in page.run("document.querySelector('svg.shape ~ .values').textContent"), "third mode")
        # The legend shows the markers of the diagram, also of many poles.
        marks = page.run(
            "[...document.querySelectorAll('figure')].flatMap(figure => [...figure.querySelectorAll('.keys button')].map(key => {"
            " const curve = [...figure.querySelectorAll('.curve')].find(c => c.dataset.name === key.textContent);"
            " const mark = root => [...root.querySelectorAll('path')].map(p => /M[\\d. ]+([a-z][^M]*)/i.exec(p.getAttribute('d'))?.[1]"
            ".replace(/[-\\d. ]/g, '')).at(-1);"
            " return [key.textContent, mark(key), mark(curve)]; }))"
        )
        poles = [row for row in marks if "pole" in row[0]]
        self.check(len(poles) == 2 and all(key == drawn for _, key, drawn in poles), f"legend of poles: {marks}")
        # The cursor names the poles in words.
        left, top, right, bottom = box(page, "figure")
        spots = page.run(
            "(() => { const p = [...document.querySelectorAll('figure .curve')].find(c => c.dataset.name === 'stable pole').querySelector('path');"
            " const m = p.getAttribute('d').match(/M([\\d.]+) ([\\d.]+)/), s = p.ownerSVGElement, b = s.getBoundingClientRect();"
            " const u = b.width / s.viewBox.baseVal.width; return [b.left + m[1] * u, b.top + m[2] * u]; })()"
        )
        page.mouse("mouseMoved", *spots)
        text = " ".join(values(page, "figure"))
        self.check("order 4: 12.4 Hz" in text, f"pole: {text}")
        self.close(page, "shapes")
        still = self.page("shapes", reduced=True)
        still.everything()
        first = path(still, "svg.shape .moved")
        still.run("new Promise(done => setTimeout(done, 300))")
        self.check(path(still, "svg.shape .moved") == first, "a user who prefers reduced motion sees no animation")

    def tables(self):
        page = self.page("trends")
        page.everything()
        column = "[...document.querySelectorAll('#quantities tbody tr')].map(r => parseFloat(r.cells[2].textContent.replace('−', '-')))"
        page.run("document.querySelectorAll('#quantities thead button')[2].click()")
        order = page.run(column)
        self.check(order == sorted(order), f"sorted: {order}")
        page.run("document.querySelectorAll('#quantities thead button')[2].click()")
        self.check(page.run(column) == sorted(order, reverse=True), "the same button sorts in descending order")
        shown = "[...document.querySelectorAll('#quantities figure')].filter(f => f.getBoundingClientRect().height).length"
        all_of = page.run(shown)
        page.run("(() => { const s = document.querySelector('#quantities .tools select'); s.selectedIndex = 1; s.onchange(); })()")
        self.check(0 < page.run(shown) < all_of, "the table shows a single category")
        text = page.run("document.querySelector('#changes')?.textContent ?? ''")
        self.check("run-025" in text and "step" in text, f"the step of the stiffness: {text}")
        self.close(page, "trends")

    def modes(self):
        """All modes of the JSON are in the table, which can be sorted; warnings are above it; the saved result agrees."""
        known = json.loads((self.folder / "modes.json").read_text())
        frequencies = [mode["natural_frequency_hz"]["value"] for mode in known["modes"]]
        column = "[...document.querySelector('table.sort tbody').rows].map(r => parseFloat(r.cells[1].textContent))"
        for name in ("modes", "saved"):
            page = self.page(name)
            page.everything()
            shown = page.run(column)
            right = len(shown) == len(frequencies) and all(abs(a / b - 1) < 1e-3 for a, b in zip(shown, frequencies))
            self.check(right, f"{name}: {shown} Hz for {frequencies}")
            for _ in range(2):
                page.run("document.querySelectorAll('table.sort thead button')[1].click()")
            self.check(page.run(column) == sorted(shown, reverse=True), f"{name}: the modes are sorted")
            self.check(page.run("document.querySelectorAll('svg.shape').length") == 1, f"{name}: shapes are drawn")
            warnings = "[...document.querySelectorAll('.remarks:not(.good) li')].length"
            failed = sum(not check["passed"] for check in known["checks"]) + len(known["notes"])
            self.check(page.run(warnings) == failed, f"{name}: {page.run(warnings)} of {failed} warnings")
            self.close(page, name)
        page = self.page("modes")
        self.check("laser vibrometers" in page.run("document.querySelector('.about').textContent"), "modes: details")
        self.check("--force-at '1,2'" in page.run("document.querySelector('#repeat code').textContent"), "modes: command")

    def backbone(self):
        """The frequencies over the amplitude agree with the elliptic integral; the page shows the operator from the record."""
        page = self.page("backbone")
        page.everything()
        rows = page.run(
            "[...document.querySelectorAll('#amplitude tbody tr')].map(r => [...r.cells].map(c => parseFloat(c.textContent)))"
        )
        self.check(len(rows) > 3, f"backbone: {len(rows)} amplitudes")
        for amplitude, _, frequency, *_ in rows:
            known = hardening_hz(amplitude)
            self.check(abs(frequency / known - 1) < 3e-3, f"backbone: {frequency} Hz at {amplitude} m, not {known}")
        about = page.run("document.querySelector('.about').textContent")
        self.check("M. Curie" in about and "laser 4" in about, f"details of the record: {about}")
        self.close(page, "backbone")

    def names_stay_text(self):
        page = self.page("three")
        text = page.run("document.querySelector('.about').textContent")
        self.check("<script>alert(1)</script>" in text, f"about: {text}")
        self.check(page.run("document.scripts.length") == 1, "one script")

    def cursor_values(self):
        """The curve lies within its band; far from the poles the cursor names none; a touch shows the values."""
        page = self.page("nonlinear")
        page.everything()
        figure = "#figure-restoring-force"
        left, top, right, bottom = box(page, figure, 1)
        for part in (0.23, 0.51, 0.77):
            page.mouse("mouseMoved", left + part * (right - left), (top + bottom) / 2)
            seen = " ".join(values(page, figure))
            number = r"(-?[\d.]+(?:e-?\d+)?)"
            band = re.search(f"95 % interval {number} to {number}", seen)
            value = re.search(f"identified {number} N", seen)
            self.check(band and value, f"nonlinear: the cursor shows {seen}")
            if band and value:
                low, high, value = float(band[1]), float(band[2]), float(value[1])
                self.check(low - 1e-5 * abs(low) <= value <= high + 1e-5 * abs(high), f"{value} in {low} to {high}")
        self.close(page, "nonlinear")
        page = self.page("modes")
        page.everything()
        poles = page.run(
            "JSON.parse(document.querySelector('#figure-result metadata').textContent).v[0].p[1].c"
            ".filter(c => c.i).flatMap(c => c.i).map(text => +text.match(/: ([\\d.]+) Hz/)[1]).sort((a, b) => a - b)"
        )
        gap, start = max((b - a, a) for a, b in zip(poles, poles[1:]))
        left, top, right, bottom = box(page, "#figure-result")
        page.mouse("mouseMoved", along(page, "#figure-result", start + gap / 2), (top + bottom) / 2)
        seen = values(page, "#figure-result")
        self.check(seen and not any("pole" in row for row in seen), f"modes: {gap} Hz from a pole the cursor shows {seen}")
        page = self.page("response", 390)
        page.everything()
        page.call("Emulation.setTouchEmulationEnabled", enabled=True)
        left, top, right, bottom = box(page, "figure")
        point = {"x": (left + right) / 2, "y": (top + bottom) / 2}
        page.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[point])
        page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        page.settle()
        self.check(any("measured" in row for row in values(page, "figure")), "a touch shows the values")

    def axes(self):
        """In the Nyquist display the abscissa has its name even above another panel; every display shows the bands."""
        page = self.page("response")
        page.everything()
        choose = lambda value: page.run(
            f"(() => {{ const s = document.querySelector('.tools select'); s.value = '{value}'; s.onchange(); }})()"
        )
        for display in ("nyquist", "reim", "bode"):
            choose(display)
            page.settle()
            texts = page.run("[...document.querySelectorAll('figure > svg g.panel:first-of-type text')].map(t => t.textContent)")
            if display == "nyquist":
                self.check(any(text.startswith("Real part") for text in texts), f"Nyquist: {texts}")
            bands = page.run("document.querySelectorAll('figure > svg .curve path[opacity]').length")
            self.check(bands > 0, f"{display}: {bands} bands")

    def print(self):
        """On paper no figure is split, no page is empty, and no heading ends a page; a report has at most six pages."""
        most = {"single": 6, "three": 6, "one": 6, "matrix": 3, "modes": 4}
        has_text = shutil.which("pdftotext")
        self.check(has_text or not os.environ.get("CI"), "no pdftotext")
        for name in PAGES:
            page = self.page(name)
            page.everything()
            headings = page.run("[...document.querySelectorAll('h2, h3, caption')].map(e => e.textContent.trim())")
            pdf = page.print()
            pages = len(re.findall(rb"/Type\s*/Page\b", pdf))
            self.numbers[f"{name}: printed pages"] = pages
            self.check(0 < pages <= most.get(name, 4), f"{name}: {pages} printed pages")
            if self.pictures:
                (self.pictures / f"{name}.pdf").write_bytes(pdf)
            if has_text:
                done = subprocess.run(["pdftotext", "-layout", "-", "-"], input=pdf, capture_output=True, check=True)
                for number, text in enumerate(done.stdout.decode().split("\f")[:pages], 1):
                    lines = [line.strip() for line in text.splitlines() if line.strip()]
                    self.check(len(lines) > 4, f"{name}: page {number} of {pages} has only {lines}")
                    # The last line of a page is its number.
                    self.check(not lines[-2:-1] or lines[-2] not in headings, f"{name}: page {number} ends with {lines[-2:]}")
            page.resize(718)
            page.call("Emulation.setEmulatedMedia", media="print")
            page.run("dispatchEvent(new Event('beforeprint'))")
            split = page.run(
                "[...document.querySelectorAll('figure > svg')].filter(e => e.getBoundingClientRect().height > 940"
                " || getComputedStyle(e).breakInside !== 'avoid').map(e => e.closest('figure').id)"
            )
            self.check(not split, f"{name}: figures that do not fit onto a page: {split}")
            self.browser.call("Target.closeTarget", targetId=page.target)

    def widths(self):
        for name in PAGES:
            for width in WIDTHS:
                for dark in (False, True) if width == 1280 else (False,):
                    page = self.page(name, width, dark=dark)
                    page.everything()
                    seen = page.run("document.documentElement.scrollWidth")
                    what = f"{name} at {width}{' dark' if dark else ''}"
                    self.check(seen <= width, f"{what}: {seen} px wide, {page.run(BEYOND)[:5]}")
                    overlaps = page.run(OVERLAPS)
                    self.check(not overlaps, f"{what}: texts overlap: {overlaps[:4]}")
                    lonely = page.run(LONELY)
                    self.check(lonely == 0, f"{what}: {lonely} ordinates with fewer than two numbers")
                    single = page.run(ONE_NUMBER)
                    self.check(not single, f"{what}: abscissae with fewer than two numbers: {single}")
                    faint = page.run(FAINT)
                    self.check(not faint, f"{what}: faint: {faint[:4]}")
                    if self.pictures:
                        page.screenshot(self.pictures / f"{name}-{width}{'-dark' if dark else ''}.png")
                    self.close(page, name)
                    self.browser.call("Target.closeTarget", targetId=page.target)

    def run(self):
        for test in (self.cursor_and_zoom, self.quantities, self.matrix, self.shapes, self.tables,
                     self.modes, self.backbone, self.cursor_values, self.axes,
                     self.names_stay_text, self.print, self.widths):
            start = time.monotonic()
            try:
                test()
            except (AssertionError, TimeoutError, AttributeError, TypeError) as error:
                self.check(False, f"{test.__name__}: {type(error).__name__}: {error}")
            print(f"{test.__name__}: {time.monotonic() - start:.1f} s", flush=True)
        for name, number in self.numbers.items():
            print(f"{name}: {number}")
        return self.failures


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", type=Path)
    parser.add_argument("pages", type=Path)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    if not find():
        print("no Chromium on this machine: the pages are not tested in a browser")
        return 1 if os.environ.get("CI") else 0
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        make(arguments.program.resolve(), arguments.pages.resolve(), Path(folder))
        with Browser() as browser:
            failures = Tests(browser, Path(folder), arguments.pictures).run()
    print(f"{len(failures)} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
