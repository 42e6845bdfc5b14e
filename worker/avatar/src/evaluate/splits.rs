//! Figures of the two kinds of held-out pictures: other cameras, and other poses.

use super::Score;
use serde::{Deserialize, Serialize};

/// Figures of one person.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SubjectScore {
    /// Name of the person.
    pub name: String,
    /// Figures of both splits.
    #[serde(flatten)]
    pub scores: SplitScores,
    /// PSNR of an all-black picture against the novel views, or the novel poses without any view,
    /// dB: the baseline.
    pub black_image_psnr: f64,
}

/// Figures of the two kinds of held-out pictures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SplitScores {
    /// Training poses from held-out cameras.
    pub novel_view: Score,
    /// Held-out poses.
    pub novel_pose: Score,
}

impl SplitScores {
    /// PSNR of an all-black picture against the novel views, or the novel poses without any view.
    pub fn black_psnr(&self) -> f64 {
        if self.novel_view.pictures > 0 {
            self.novel_view.black_psnr
        } else {
            self.novel_pose.black_psnr
        }
    }

    /// The mean over people, with equal weights.
    pub fn mean(subjects: &[SubjectScore]) -> Self {
        let mean = |split: fn(&SplitScores) -> &Score| {
            let scores: Vec<Score> = subjects.iter().map(|it| *split(&it.scores)).collect();
            Score::mean(&scores)
        };
        Self {
            novel_view: mean(|scores| &scores.novel_view),
            novel_pose: mean(|scores| &scores.novel_pose),
        }
    }

    /// The line of [`split_table`] about `name`.
    pub fn table_row(&self, name: &str) -> String {
        let split = |score: &Score| {
            let Score {
                psnr,
                psnr_mask_box,
                ssim,
                black_psnr,
                pictures,
                ..
            } = score;
            if *pictures == 0 {
                return format!("{:^33}", "no pictures");
            }
            format!("{psnr:>8.2} {psnr_mask_box:>8.2} {ssim:>7.4} {black_psnr:>7.2}")
        };
        format!(
            "{name:<12} |{} |{}",
            split(&self.novel_view),
            split(&self.novel_pose)
        )
    }
}

/// The lines of a table: two headings, one line per person, and their `mean` if they are several.
pub fn split_table(subjects: &[SubjectScore], mean: &SplitScores) -> Vec<String> {
    let columns = format!("{:>8} {:>8} {:>7} {:>7}", "PSNR", "in box", "SSIM", "black");
    let mut lines = vec![
        format!("{:<12} |{:^33} |{:^33}", "", "novel views", "novel poses"),
        format!("{:<12} |{columns} |{columns}", "person"),
    ];
    lines.extend(subjects.iter().map(|it| it.scores.table_row(&it.name)));
    if subjects.len() > 1 {
        lines.push(mean.table_row("mean"));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(psnr: f64) -> Score {
        Score {
            psnr,
            psnr_mask_box: psnr - 5.0,
            ssim: 0.9,
            ssim_uniform: 0.91,
            ssim_inflated: 0.93,
            lpips: None,
            black_psnr: 18.0,
            pictures: 8,
        }
    }

    fn subjects() -> Vec<SubjectScore> {
        let subject = |name: &str, psnr: f64| SubjectScore {
            name: name.into(),
            scores: SplitScores {
                novel_view: score(psnr),
                novel_pose: score(psnr - 1.0),
            },
            black_image_psnr: 18.0,
        };
        vec![subject("ada", 28.0), subject("bob", 26.0)]
    }

    #[test]
    fn the_mean_counts_people_alike() {
        let mean = SplitScores::mean(&subjects());
        assert_eq!(mean.novel_view.psnr, 27.0);
        assert_eq!(mean.novel_pose.psnr, 26.0);
        assert_eq!(mean.novel_view.pictures, 16);
    }

    #[test]
    fn the_table_names_everybody() {
        let subjects = subjects();
        let table = split_table(&subjects, &SplitScores::mean(&subjects)).join("\n");
        for text in ["ada", "bob", "mean", "28.00", "23.00"] {
            assert!(table.contains(text), "{text} in\n{table}");
        }
        assert_eq!(split_table(&subjects[..1], &subjects[0].scores).len(), 3);
    }
}
