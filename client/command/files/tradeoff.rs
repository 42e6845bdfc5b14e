//! Files of a measured trade-off of quality and time.

#[cfg(feature = "embedded")]
use anyhow::Context;
#[cfg(feature = "embedded")]
use yoto_avatar::tradeoff::{Curve, Tradeoff};
#[cfg(feature = "embedded")]
use yoto_client::YotoClient;

/// Whether a trade-off has files of this name.
pub(crate) fn is_of_tradeoff(name: &str) -> bool {
    ["tradeoff.", "rendering.", "training."]
        .iter()
        .any(|start| name.starts_with(start))
}

/// Reads `json`, the curve that was measured of `checkpoint`.
#[cfg(feature = "embedded")]
pub(crate) async fn read_tradeoff(
    client: &YotoClient,
    checkpoint: &str,
    json: &[u8],
) -> anyhow::Result<Tradeoff> {
    let curve = Curve::from_json(json).with_context(|| format!("the trade-off of {checkpoint}"))?;
    let model = checkpoint.split("/checkpoints/").next();
    let model = client.get_model(model.unwrap_or(checkpoint)).await?;
    Ok(Tradeoff::of_model(&model.display_name, curve))
}
