//! Errors of builds that lack a feature of the crate.

use crate::clip::fault;
use crate::{ImportError, MattingModel, Options};

/// How a user gets a client with `feature`.
pub(crate) fn how_to_get(feature: &str) -> String {
    format!(
        "`cargo run --features yoto/{feature} --bin yoto -- …` runs one that has it, `cargo install --path \
         client --features {feature}` installs it"
    )
}

/// The error of a client that has no runtime for networks, about `model`.
pub(crate) fn no_matting(model: &MattingModel) -> ImportError {
    let message = format!(
        "a matting model needs a runtime for ONNX, which this client was built without: {}; or make the \
         masks elsewhere and name them with --masks",
        how_to_get("matting")
    );
    fault(&model.path, "UNSUPPORTED", message)
}

/// Checks that this build supports `options`, before minutes of work.
///
/// # Errors
/// A matting model, if the client has no runtime for networks.
pub(crate) fn ensure_built(options: &Options) -> Result<(), ImportError> {
    match &options.matting {
        Some(model) if cfg!(not(feature = "matting")) => Err(no_matting(model)),
        _ => Ok(()),
    }
}
