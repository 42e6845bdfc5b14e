//! Where the weights of the networks of LPIPS are.

use anyhow::bail;
use clap::Args;
use clap::builder::OsStringValueParser;
use std::ffi::OsString;
use yoto_avatar::loss::lpips::LpipsWeights;

const VGG16: &str = "YOTO_VGG16_WEIGHTS";
const HEADS: &str = "YOTO_LPIPS_WEIGHTS";

/// With both files LPIPS is measured, and minimised in patches of 16 pixels or more.
#[derive(Debug, Clone, Default, Args)]
pub(super) struct LpipsArgs {
    /// torchvision's VGG16, .pth or safetensors; needed for LPIPS.
    #[arg(
        long,
        env = VGG16,
        value_name = "FILE",
        value_parser = OsStringValueParser::new(),
        hide_short_help = true
    )]
    vgg16_weights: Option<OsString>,
    /// Linear heads of LPIPS 0.1 for VGG, .pth or safetensors; needed for LPIPS.
    #[arg(
        long,
        env = HEADS,
        value_name = "FILE",
        value_parser = OsStringValueParser::new(),
        hide_short_help = true
    )]
    lpips_weights: Option<OsString>,
}

impl LpipsArgs {
    /// Both files, or none. An empty name counts as none.
    ///
    /// # Errors
    /// When one is set without the other, which is most likely a mistake.
    pub(super) fn weights(self) -> anyhow::Result<Option<LpipsWeights>> {
        let file = |name: Option<OsString>| name.filter(|name| !name.is_empty());
        let one_of_two = |set, missing| {
            format!("{set} is set but {missing} is not: LPIPS needs both files of weights")
        };
        match (file(self.vgg16_weights), file(self.lpips_weights)) {
            (Some(vgg16), Some(heads)) => Ok(Some(LpipsWeights {
                vgg16: vgg16.into(),
                heads: heads.into(),
            })),
            (None, None) => Ok(None),
            (Some(_), None) => bail!(one_of_two(VGG16, HEADS)),
            (None, Some(_)) => bail!(one_of_two(HEADS, VGG16)),
        }
    }
}
