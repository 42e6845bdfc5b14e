//! The options for a matting model.

use clap::Args;
use std::path::PathBuf;
use yoto_import::{Levels, MattingModel};

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
    matting_levels: Option<Levels>,
}

impl MattingArgs {
    /// The model, if one was named.
    pub(super) fn model(&self) -> Option<MattingModel> {
        let path = self.matting_model.clone();
        path.map(|path| MattingModel {
            path,
            levels: self.matting_levels,
        })
    }
}
