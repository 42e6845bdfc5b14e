//! Plain tables.

use yoto_proto::text::one_line;

/// Longest cell, characters.
const CELL_CHARACTERS: usize = 200;

/// Rows of equal length as aligned columns under a header. Line breaks in a cell become spaces, and long cells are cut.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let cells = |row: &Vec<String>| -> Vec<String> {
        row.iter()
            .map(|cell| one_line(cell, CELL_CHARACTERS))
            .collect()
    };
    let rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
    let width = |column: usize| {
        let cells = rows
            .iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count());
        cells
            .chain(header.get(column).map(|title| title.len()))
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let padded: Vec<String> = cells
            .zip(&widths)
            .map(|(cell, &width)| format!("{cell:<width$}"))
            .collect();
        padded.join("  ").trim_end().to_owned()
    };
    let mut lines = vec![line(&mut header.iter().copied())];
    lines.extend(
        rows.iter()
            .map(|row| line(&mut row.iter().map(String::as_str))),
    );
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_wrote_stays_in_its_cell() {
        let rows = vec![
            vec!["a\nb".into(), "\u{1b}[2J".into()],
            vec!["x".repeat(10_000), "y".into()],
        ];
        let table = table(&["NAME", "CONSENT"], &rows);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines.len(), 3, "{table}");
        assert!(lines[1].starts_with("a b "), "{table}");
        assert!(lines[1].ends_with("\\u{1b}[2J"), "{table}");
        assert!(lines[2].chars().count() < 2 * CELL_CHARACTERS);
    }

    #[test]
    fn columns_align() {
        let rows = vec![
            vec!["subjects/1".into(), "ada".into()],
            vec!["s".into(), "".into()],
        ];
        assert_eq!(
            table(&["NAME", "PERSON"], &rows),
            "NAME        PERSON\nsubjects/1  ada\ns"
        );
    }
}
