//! The table of options for `--help`.

use super::flags::FLAGS;
use super::table::readers;

/// The table for `--help`: each option with the formats that read it.
pub fn options_by_format() -> String {
    let widest = FLAGS.iter().map(|(_, name, _)| name.len()).max();
    let width = widest.unwrap_or_default();
    let line = |(flag, name, _)| {
        let mut line = format!("  {name:width$} ");
        let mut column = line.len();
        for (at, format) in readers(flag).iter().enumerate() {
            let word = if at == 0 {
                format!(" {format}")
            } else {
                format!(", {format}")
            };
            if column + word.len() > 98 {
                line += &format!(",\n{:1$}", "", width + 4);
                line += format;
                column = width + 4 + format.len();
            } else {
                column += word.len();
                line += &word;
            }
        }
        line + "\n"
    };
    let lines: String = FLAGS.into_iter().map(line).collect();
    format!("Options that only some formats read, and are errors with others:\n{lines}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_has_every_option_and_fits() {
        let help = options_by_format();
        for (_, name, _) in FLAGS {
            assert!(help.contains(&format!("  {name} ")), "{help}");
        }
        assert!(help.lines().all(|line| line.len() <= 100), "{help}");
        assert!(
            help.contains("--view           zju, bvh, easymocap\n"),
            "{help}"
        );
    }
}
