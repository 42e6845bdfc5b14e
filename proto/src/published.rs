//! Published figures of the YOTO paper (arXiv 2303.05835), for reports.
//!
//! They are Table 3, means over the six ZJU-MoCap subjects by the protocol `zju-all`. Figures of
//! other captures, sizes or budgets are not comparable with them, which reports must state.

/// Conditions of the published figures.
pub const MEASURED_ON: &str = "6 ZJU-MoCap subjects, 512 pixels, 400,000 iterations";

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Name of the variant in this program.
    pub variant: &'static str,
    /// PSNR, dB.
    pub psnr: f64,
    /// SSIM; the paper gives neither window nor data range.
    pub ssim: f64,
    /// LPIPS with VGG, not scaled (the paper gives it times 1000); lower is better.
    pub lpips: f64,
}

/// The rows of the table.
pub const TABLE: &[Published] = &[
    Published {
        variant: "yoto",
        psnr: 30.51,
        ssim: 0.9588,
        lpips: 0.030_20,
    },
    Published {
        variant: "no-pose-condition",
        psnr: 30.41,
        ssim: 0.9583,
        lpips: 0.030_39,
    },
    Published {
        variant: "no-identity",
        psnr: 28.72,
        ssim: 0.9501,
        lpips: 0.039_35,
    },
    Published {
        variant: "humannerf",
        psnr: 30.22,
        ssim: 0.9555,
        lpips: 0.033_40,
    },
];

/// The published row of a variant.
pub fn of(variant: &str) -> Option<&'static Published> {
    TABLE.iter().find(|row| row.variant == variant)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variant_has_a_row() {
        for (variant, _) in crate::tiers::VARIANTS {
            assert!(of(variant).is_some(), "{variant}");
        }
        assert_eq!(of("nerf"), None);
    }
}
