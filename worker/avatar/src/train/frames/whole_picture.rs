//! The loss of a whole frame, for models of splats: their pictures cost by splats, not by pixels.

use crate::avatar::AvatarSplats;
use crate::config::ModelConfig;
use crate::host::ReadError;
use crate::loss::LossTerm;
use crate::render::splats::body_view;
use crate::train::frames::batch::Scene;
use burn::tensor::Tensor;
use tracing::trace_span;
use yoto_capture::camera::Camera;
use yoto_capture::{FrameImage, mask_box};
use yoto_ops::picture_loss::{Target, Weights, picture_loss};
use yoto_ops::splat::splat;

/// Name of the objective in reports.
pub(crate) const OBJECTIVE: &str = "l1+ssim";
/// Colours are compared in the person's box and this part of the picture's width around it.
const MARGIN: usize = 32;

/// The model's picture `[H W, 4]` of a frame: colours over black, and opacity.
///
/// # Errors
/// If the splats can't be read from their device.
pub(crate) fn render_frame(
    avatar: AvatarSplats<'_>,
    scene: &Scene,
    camera: &Camera,
) -> Result<Tensor<2>, ReadError> {
    let body = scene.body;
    let splats = trace_span!("pose").in_scope(|| {
        let posed = avatar.pose(body, scene.slot, scene.pose, scene.schedule_progress);
        avatar.posed_splats(body, &posed)
    })?;
    let body_view = body_view(&body.skeleton, scene.pose, camera);
    Ok(trace_span!("splat").in_scope(|| splat(splats, &body_view)))
}

/// The loss of a frame, `[1]`, and its terms, from the model's `picture` `[H W, 4]` of it.
pub(crate) fn frame_loss(
    picture: Tensor<2>,
    image: &FrameImage,
    config: &ModelConfig,
) -> (Tensor<1>, Vec<LossTerm>) {
    let unlike = config.optimise.ssim_weight as f32;
    let weights = Weights {
        absolute: 1.0 - unlike,
        ssim: unlike,
        mask: config.optimise.mask_weight as f32,
    };
    let target = Target {
        width: image.width,
        height: image.height,
        rgb: image.rgb.as_slice().into(),
        mask: image.mask.as_slice().into(),
        region: region(image),
        weights,
    };
    let terms = trace_span!("compare").in_scope(|| picture_loss(picture, &target));
    let term = |name, weight: f32, index: usize| LossTerm {
        name,
        weight: f64::from(weight),
        value: terms.clone().narrow(0, index, 1).detach(),
    };
    let named = vec![
        term("l1", weights.absolute, 1),
        term("1-ssim", weights.ssim, 2),
        term("mask", weights.mask, 3),
    ];
    (terms.narrow(0, 0, 1), named)
}

/// The person's box with a margin, or all of a picture without a person.
fn region(image: &FrameImage) -> [usize; 4] {
    let (width, height) = (image.width, image.height);
    match mask_box(&image.mask, width, height) {
        Some(region) => {
            let margin = width / MARGIN;
            [
                region.x0.saturating_sub(margin),
                region.y0.saturating_sub(margin),
                (region.x1 + margin).min(width),
                (region.y1 + margin).min(height),
            ]
        }
        None => [0, 0, width, height],
    }
}
