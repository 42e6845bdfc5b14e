//! Figures of people as a table.

use crate::table::table;
use yoto_proto::v1::Scores;

/// Legend of the columns.
const LEGEND: &str = "\
PSNR in dB. SSIM in the Gaussian 11x11 window, data range 1. SSIM-7: uniform 7x7 window,
data range 1. (SSIM-7/2): the same with data range 2, inflated as some published tables are.
LPIPS with VGG, times 1000, lower is better; '-' without its weights. BLACK: PSNR of an
all-black picture.";

/// One line per named row, with the legend below.
pub fn scores_table(rows: &[(String, Scores)]) -> String {
    let header = [
        "OF",
        "PICTURES",
        "PSNR",
        "IN BOX",
        "SSIM",
        "SSIM-7",
        "(SSIM-7/2)",
        "LPIPS",
        "BLACK",
    ];
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|(name, scores)| {
            vec![
                name.clone(),
                scores.pictures.to_string(),
                format!("{:.2}", scores.psnr),
                format!("{:.2}", scores.psnr_mask_box),
                format!("{:.4}", scores.ssim),
                format!("{:.4}", scores.ssim_uniform),
                format!("({:.4})", scores.ssim_inflated),
                thousandfold(scores.lpips),
                format!("{:.2}", scores.black_psnr),
            ]
        })
        .collect();
    format!("{}\n\n{LEGEND}", table(&header, &cells))
}

/// LPIPS in the form of published tables, `-` if it was not measured.
fn thousandfold(lpips: Option<f64>) -> String {
    lpips.map_or_else(|| "-".to_owned(), |value| format!("{:.2}", 1000.0 * value))
}

/// The rows for programs: PSNR in dB, LPIPS where it was measured.
pub fn scores_json(rows: &[(String, Scores)]) -> serde_json::Value {
    let row = |(of, it): &(String, Scores)| {
        serde_json::json!({
            "of": of,
            "pictures": it.pictures,
            "psnr": it.psnr,
            "psnr_mask_box": it.psnr_mask_box,
            "ssim": it.ssim,
            "ssim_uniform": it.ssim_uniform,
            "lpips": it.lpips,
            "black_psnr": it.black_psnr,
        })
    };
    rows.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_measured_is_a_dash() {
        let scores = Scores {
            pictures: 4,
            psnr: 27.126,
            ssim: 0.93,
            ..Scores::default()
        };
        let measured = Scores {
            lpips: Some(0.030_2),
            ..scores
        };
        let text = scores_table(&[("ada".into(), scores), ("mean".into(), measured)]);
        let line = |name: &str| {
            let found = text.lines().find(|line| line.starts_with(name));
            let cells = found.expect("a line").split_whitespace();
            cells.map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(line("ada")[1..5], ["4", "27.13", "0.00", "0.9300"]);
        assert_eq!(line("ada")[7], "-");
        assert_eq!(line("mean")[7], "30.20");
    }
}
