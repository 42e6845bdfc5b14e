//! The paper's table of variants, measured beside published figures.

use yoto_proto::published::{MEASURED_ON, TABLE};
use yoto_proto::v1::Scores;

/// Measured figures of one variant.
pub struct Row {
    /// Name in the contract.
    pub variant: String,
    /// Means over people, one for each heading of the table.
    pub scores: Vec<Scores>,
}

/// Width of three figures, characters.
const GROUP: usize = 25;

/// All variants in the paper's order; `headings` names each group of measured figures.
/// Variants without measurements have dashes.
pub fn paper_table(headings: &[String], rows: &[Row]) -> String {
    let figures =
        |psnr: String, ssim: String, lpips: String| format!("{psnr:>7} {ssim:>8} {lpips:>8}");
    let line = |name: &str, groups: Vec<String>| format!("{name:<18}| {}", groups.join(" | "));
    let mut titles: Vec<String> = headings.iter().map(|it| format!("{it:^GROUP$}")).collect();
    titles.push(format!("{:^GROUP$}", "published"));
    let columns = figures("PSNR".into(), "SSIM".into(), "LPIPS".into());
    let mut lines = vec![
        line("", titles).trim_end().to_owned(),
        line("variant", vec![columns; headings.len() + 1]),
    ];
    for published in TABLE {
        let ours = rows.iter().find(|row| row.variant == published.variant);
        let mut groups: Vec<String> = (0..headings.len())
            .map(|i| match ours.and_then(|row| row.scores.get(i)) {
                Some(scores) => figures(
                    format!("{:.2}", scores.psnr),
                    format!("{:.4}", scores.ssim),
                    thousandfold(scores.lpips),
                ),
                None => figures("-".into(), "-".into(), "-".into()),
            })
            .collect();
        groups.push(figures(
            format!("{:.2}", published.psnr),
            format!("{:.4}", published.ssim),
            thousandfold(Some(published.lpips)),
        ));
        lines.push(line(published.variant, groups));
    }
    lines.push(format!(
        "PSNR in dB, LPIPS times 1000. Ours: SSIM in the Gaussian 11x11 window, data range 1.\n\
         Published: {MEASURED_ON}; the paper names neither SSIM's window nor\n\
         its data range. Figures of other captures, sizes and budgets can't be compared with it."
    ));
    lines.join("\n")
}

/// LPIPS in the form of published tables, `-` if it was not measured.
fn thousandfold(lpips: Option<f64>) -> String {
    lpips.map_or_else(|| "-".to_owned(), |value| format!("{:.2}", 1000.0 * value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variant_stands_beside_what_was_published() {
        let scores = Scores {
            psnr: 25.5,
            ssim: 0.9,
            lpips: Some(0.05),
            ..Scores::default()
        };
        let rows = [Row {
            variant: "no-identity".into(),
            scores: vec![scores, Scores::default()],
        }];
        let text = paper_table(&["held-out views".into(), "held-out poses".into()], &rows);
        let line = |name: &str| {
            let found = text.lines().find(|line| line.starts_with(name));
            let cells = found.expect("a line").split_whitespace();
            cells.map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(
            line("no-identity"),
            [
                "no-identity",
                "|",
                "25.50",
                "0.9000",
                "50.00",
                "|",
                "0.00",
                "0.0000",
                "-",
                "|",
                "28.72",
                "0.9501",
                "39.35"
            ]
        );
        let yoto = line("yoto");
        assert_eq!(yoto[1..5], ["|", "-", "-", "-"]);
        assert_eq!(yoto[10..], ["30.51", "0.9588", "30.20"]);
        let bars = |line: &str| {
            line.match_indices('|')
                .map(|(at, _)| at)
                .collect::<Vec<_>>()
        };
        let columns: Vec<_> = text.lines().take(6).map(bars).collect();
        assert!(columns.windows(2).all(|pair| pair[0] == pair[1]), "{text}");
    }
}
