"""What a reader of a report would object to on screen, measured in the browser."""

from browser_pages import Browser

# Words and numbers that stand on two lines. Names may break after / and _, where the page says so with <wbr>,
# and after a hyphen; within a cell only if they are longer than 16 characters. A hash may break anywhere.
BROKEN_WORDS = r"""
const broken = [];
const lines = range =>
  new Set([...range.getClientRects()].filter(b => b.width).map(b => Math.round(b.top))).size;
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const text = walker.currentNode, cell = text.parentElement.closest('th, td');
  const word = /[\p{L}\p{N}]+(?:[.,'’][\p{L}\p{N}]+)*/gu, range = document.createRange();
  for (const pattern of cell ? [word, /(?<!\S)\S{1,16}(?!\S)/g] : [word]) {
    for (const found of text.data.matchAll(pattern)) {
      range.setStart(text, found.index);
      range.setEnd(text, found.index + found[0].length);
      if (lines(range) > 1 && !/^[0-9a-f]{32,}$/.test(found[0])) broken.push(found[0]);
    }
  }
}
return broken;
"""


def faults_at(browser: Browser, width: int) -> list[str]:
    """Return what is wrong with the open report in a window of this width; narrow ones let tables scroll."""
    browser.resize(width)
    faults = browser.overflowing(".wide" if width <= 1024 else "")
    if (wide := browser.run("return document.documentElement.scrollWidth")) > width:
        faults.append(f"the page is {wide} wide")
    faults += [f"broken: {word}" for word in browser.run(BROKEN_WORDS)]
    return [f"at {width}: {fault}" for fault in faults]
