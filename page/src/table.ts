/** A table that a click on a column header sorts. */

import { el } from "./dom";
import { sorted, type Column } from "./sorting";

export function table<Row>(
  caption: string,
  columns: Column<Row>[],
  rows: Row[],
  choose: (row: Row) => void,
): HTMLElement {
  const body = el("tbody");
  const heads = columns.map((column) => {
    const button = el("button", { type: "button", text: column.title });
    const head = el(
      "th",
      { class: column.numeric ? "numeric" : "", aria: { sort: "none" } },
      button,
    );
    head.scope = "col";
    button.onclick = () => sort(column, head.getAttribute("aria-sort") === "ascending");
    return head;
  });

  const fill = (shown: Row[]) =>
    body.replaceChildren(
      ...shown.map((row) => {
        const line = el("tr", { class: "choice" });
        line.tabIndex = 0;
        line.onclick = () => choose(row);
        line.onkeydown = (event) => {
          if (event.key === "Enter") choose(row);
        };
        line.append(
          ...columns.map((column) => {
            const content = column.text?.(row) ?? String(column.key(row) ?? "");
            return el("td", { class: column.numeric ? "numeric" : "" }, content);
          }),
        );
        return line;
      }),
    );

  const sort = (column: Column<Row>, descending: boolean) => {
    heads.forEach((head, i) => {
      const state = columns[i] === column ? (descending ? "descending" : "ascending") : "none";
      head.setAttribute("aria-sort", state);
    });
    fill(sorted(rows, column, descending));
  };

  fill(rows);
  return el(
    "div",
    { class: "table-scroll" },
    el(
      "table",
      { class: "rows" },
      el("caption", { class: "off-screen", text: caption }),
      el("thead", {}, el("tr", {}, ...heads)),
      body,
    ),
  );
}
