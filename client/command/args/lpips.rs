//! Where the weights of the networks of LPIPS are.

use clap::Args;
use clap::builder::OsStringValueParser;
use std::ffi::OsString;
use yoto_avatar::loss::lpips::{HEADS_VARIABLE, HalfOfWeights, LpipsWeights, VGG16_VARIABLE};

/// With both files LPIPS is measured, and minimised in patches of 16 pixels or more.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct LpipsArgs {
    /// torchvision's VGG16, .pth or safetensors; needed for LPIPS.
    #[arg(
        long,
        env = VGG16_VARIABLE,
        value_name = "FILE",
        value_parser = OsStringValueParser::new(),
        hide_short_help = true
    )]
    vgg16_weights: Option<OsString>,
    /// Linear heads of LPIPS 0.1 for VGG, .pth or safetensors; needed for LPIPS.
    #[arg(
        long,
        env = HEADS_VARIABLE,
        value_name = "FILE",
        value_parser = OsStringValueParser::new(),
        hide_short_help = true
    )]
    lpips_weights: Option<OsString>,
}

impl LpipsArgs {
    /// Both files, or none.
    ///
    /// # Errors
    /// As [`LpipsWeights::both`].
    pub(crate) fn weights(self) -> Result<Option<LpipsWeights>, HalfOfWeights> {
        LpipsWeights::both(
            self.vgg16_weights.map(Into::into),
            self.lpips_weights.map(Into::into),
        )
    }
}
