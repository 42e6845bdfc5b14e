//! The part of each splat in the model's error.

use crate::avatar::AvatarAppearance;
use crate::host::read;
use crate::train::TrainError;
use crate::train::exposure::{apply_exposure, near};
use crate::train::frames::whole_picture::render_frame;
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::poses::fit::pose;
use crate::train::run::Moment;
use burn::tensor::{Tensor, TensorData};

/// Most frames that errors are summed over.
const FRAMES: usize = 24;

/// Σ over pixels of w |e| `[N]`, of a splat's weight w in a pixel and the pixel's mean absolute error e, over
/// frames that are spread over the film of the `subject`. A weight is the gradient of the pixel's colour to
/// the splat's, so that one backward pass per frame gives all sums. Empty for a model without splats.
pub(super) fn errors(
    model: &Model,
    subject: &TrainSubject,
    now: Moment,
) -> Result<Vec<f64>, TrainError> {
    let splats = match model.appearance() {
        AvatarAppearance::Splats(splats) => splats,
        AvatarAppearance::Field(_) => return Ok(Vec::new()),
    };
    let colours = splats.splats[subject.own_slot].colours.val();
    let mut sums = vec![0.0; colours.dims()[0]];
    let stride = subject.frames.len().div_ceil(FRAMES).max(1);
    for frame in subject.frames.iter().step_by(stride) {
        let pose = pose(&model.state, subject, frame);
        let scene = model.scene(subject, &pose, now);
        let index = subject.track.frames[frame.position].index;
        let exposure = near(&model.state.exposures, subject.slot, index);
        let picture = apply_exposure(render_frame(splats, &scene, &frame.camera)?, &exposure);
        let image = subject.image(frame);
        let seen = read(picture.clone().detach())?;
        let pairs = seen.chunks_exact(4).zip(image.rgb.chunks_exact(3));
        let error = |(seen, truth): (&[f32], &[u8])| {
            let apart = |c: usize| (seen[c] - f32::from(truth[c]) / 255.0).abs();
            let mean = (apart(0) + apart(1) + apart(2)) / 3.0;
            [mean, mean, mean, 0.0]
        };
        let errors: Vec<f32> = pairs.flat_map(error).collect();
        let pixels = errors.len() / 4;
        let errors = TensorData::new(errors, [pixels, 4]);
        let errors = Tensor::from_data(errors, &picture.device());
        let gradients = (picture * errors).sum().backward();
        let Some(found) = colours.grad(&gradients) else {
            continue;
        };
        for (sum, row) in sums.iter_mut().zip(read(found)?.chunks_exact(3)) {
            *sum += row.iter().map(|value| f64::from(value.abs())).sum::<f64>() / 3.0;
        }
    }
    Ok(sums)
}
