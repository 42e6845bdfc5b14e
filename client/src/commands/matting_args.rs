//! The options for a matting model.

use crate::import::MattingModel;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use yoto_matting::Levels;

/// Masks of a clip by a network that the user has.
#[derive(Debug, Args)]
pub(super) struct MattingArgs {
    /// Make the masks of a clip by this network: MODNet, U²-Net, IS-Net, BiRefNet, RVM or the like, in
    /// ONNX.
    #[arg(long, value_name = "FILE", conflicts_with = "masks")]
    matting_model: Option<PathBuf>,
    /// Levels of the pictures that the matting model was trained with [default: RVM's are unit; those
    /// whose masks agree best with the pose model's, in a clip alone].
    #[arg(long, value_enum, value_name = "LEVELS", requires = "matting_model")]
    matting_levels: Option<LevelsArg>,
}

/// Levels of pictures, for networks.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum LevelsArg {
    /// 0 to 1: RVM.
    Unit,
    /// -1 to 1: MODNet.
    Signed,
    /// -0.5 to 0.5: IS-Net, RMBG 1.4.
    Centred,
    /// Less ImageNet's mean, by its deviation: U²-Net, BiRefNet, RMBG 2.0.
    #[value(name = "imagenet")]
    ImageNet,
}

impl MattingArgs {
    /// The model, if one was named.
    pub(super) fn model(&self) -> Option<MattingModel> {
        let levels = self.matting_levels.map(|levels| match levels {
            LevelsArg::Unit => Levels::Unit,
            LevelsArg::Signed => Levels::Signed,
            LevelsArg::Centred => Levels::Centred,
            LevelsArg::ImageNet => Levels::ImageNet,
        });
        let path = self.matting_model.clone();
        path.map(|path| MattingModel { path, levels })
    }
}
