//! The matting model that a user names.

use std::path::PathBuf;

/// Levels of a network's pictures. A network's file does not name the levels of its training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Levels {
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

/// A matting model that the user names.
#[derive(Clone, Debug)]
pub struct MattingModel {
    /// Its ONNX file.
    pub path: PathBuf,
    /// The levels of its pictures, if the user gives them.
    pub levels: Option<Levels>,
}

impl MattingModel {
    /// Its name, for people.
    pub(crate) fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }
}
