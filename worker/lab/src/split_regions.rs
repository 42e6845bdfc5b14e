//! Error by region in reports, of both kinds of held-out pictures.

use serde::{Deserialize, Serialize};
use yoto_avatar::evaluate::{Region, RegionError};

/// Errors of the regions of both kinds of held-out pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SplitRegions {
    /// Training poses from held-out cameras.
    pub novel_view: Vec<RegionError>,
    /// Held-out poses.
    pub novel_pose: Vec<RegionError>,
}

impl SplitRegions {
    /// A line per kind of picture that was measured.
    pub(super) fn lines(&self) -> Vec<String> {
        let kinds = [
            ("novel views", &self.novel_view),
            ("novel poses", &self.novel_pose),
        ];
        let line = |(kind, errors): (&str, &Vec<RegionError>)| {
            let parts: Vec<String> = errors
                .iter()
                .map(|it| {
                    let psnr = it
                        .psnr
                        .map_or("exact".into(), |psnr| format!("{psnr:.1} dB"));
                    let share = format!("{} {:.0} %", it.region.name(), 100.0 * it.share_of_error);
                    match it.region {
                        Region::Around => format!("{share} (mean opacity {:.4})", it.opacity),
                        _ => format!("{share} ({psnr})"),
                    }
                })
                .collect();
            (!parts.is_empty()).then(|| format!("squared error of {kind}: {}", parts.join(", ")))
        };
        kinds.into_iter().filter_map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_name_the_measured_pictures_alone() {
        let error = |region, psnr| RegionError {
            region,
            share_of_error: 0.5,
            share_of_pixels: 0.1,
            psnr,
            opacity: 0.0123,
        };
        let regions = SplitRegions {
            novel_view: Vec::new(),
            novel_pose: vec![
                error(Region::Outline, Some(17.54)),
                error(Region::Hands, None),
                error(Region::Around, Some(40.0)),
            ],
        };
        let expected = "squared error of novel poses: outline 50 % (17.5 dB), hands 50 % (exact), \
             around 50 % (mean opacity 0.0123)";
        assert_eq!(regions.lines(), [expected]);
    }
}
