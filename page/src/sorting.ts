/** Rows in the order of a column. */

export interface Column<Row> {
  title: string;
  /** What rows are sorted by. */
  key: (row: Row) => number | string | null;
  /** What is written, where it differs from the key. */
  text?: (row: Row) => string | Node;
  numeric?: boolean;
}

export function sorted<Row>(rows: Row[], column: Column<Row>, descending: boolean): Row[] {
  const sign = descending ? -1 : 1;
  return [...rows].sort((a, b) => {
    const [one, other] = [column.key(a), column.key(b)];
    // Unknown values come last, in both directions.
    if (one === null || other === null) return Number(one === null) - Number(other === null);
    if (typeof one === "number" && typeof other === "number") return sign * (one - other);
    return sign * String(one).localeCompare(String(other), "en", { numeric: true });
  });
}
