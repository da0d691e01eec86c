// Tables of any length: sorted by their headings, searched, and shown in parts.
const LENGTH = 50;
for (const listing of document.querySelectorAll(".listing")) {
  const {headings, rows, shown} = JSON.parse(listing.querySelector("script").textContent);
  const words = rows.map(row => row.join(" ").toLowerCase());
  const body = listing.querySelector("tbody"), status = listing.querySelector("[role=status]");
  const search = listing.querySelector("input"), opened = listing.querySelector(".opened");
  let order = rows.map((_, place) => place), found = order, start = 0, sorted = [0, 1];

  function element(tag, text) {
    const made = document.createElement(tag);
    made.textContent = text;
    return made;
  }
  function open(row) {
    const table = document.createElement("table");
    headings.forEach((heading, k) => {
      const line = table.insertRow();
      line.append(element("th", heading), element("td", row[k + 1]));
      line.lastChild.className = "long";
    });
    opened.replaceChildren(element("h3", row[1]), table);
    if (row[0]) {
      const link = element("a", "Report of this recording");
      link.href = row[0];
      opened.append(link);
    }
  }
  function fill() {
    body.replaceChildren(...found.slice(start, start + LENGTH).map(place => {
      const row = rows[place], line = document.createElement("tr");
      const name = row[0] ? element("a", row[1]) : element("button", row[1]);
      if (row[0]) { name.href = row[0]; } else { name.type = "button"; }
      name.addEventListener("click", () => open(row));
      line.append(document.createElement("td"));
      line.firstChild.append(name);
      for (const cell of row.slice(2, shown + 1)) { line.append(element("td", cell)); }
      return line;
    }));
    const last = Math.min(start + LENGTH, found.length);
    status.textContent = `${found.length ? start + 1 : 0} to ${last} of ${found.length}`;
  }
  function narrow() {
    const wanted = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    found = order.filter(place => wanted.every(word => words[place].includes(word)));
    start = 0;
    fill();
  }
  function sort(column) {
    sorted = [column, sorted[0] === column ? -sorted[1] : 1];
    const compare = (a, b) => typeof a === "number" && typeof b === "number"
      ? a - b : String(a) < String(b) ? -1 : String(a) > String(b) ? 1 : 0;
    order.sort((a, b) => sorted[1] * compare(rows[a][column], rows[b][column]));
    for (const head of listing.querySelectorAll("th[scope]")) {
      const own = head.firstChild.dataset.sort === String(column);
      head.ariaSort = own ? (sorted[1] > 0 ? "ascending" : "descending") : "none";
    }
    narrow();
  }
  search.addEventListener("input", narrow);
  for (const each of listing.querySelectorAll("[data-sort]")) {
    each.addEventListener("click", () => sort(Number(each.dataset.sort)));
  }
  for (const each of listing.querySelectorAll("[data-turn]")) {
    each.addEventListener("click", () => {
      const next = start + LENGTH * Number(each.dataset.turn);
      if (next >= 0 && next < found.length) { start = next; fill(); }
    });
  }
  fill();
}
