//! Random patches of a frame (HumanNeRF, `core/data/human_nerf/train.py`).

use crate::motion::body::CanonicalBody;
use crate::train::frames::batch::Batch;
use crate::train::people::Picture;
use rand::RngExt;
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::{Camera, Pose};

/// Share of the patches that are centred on the person; the others are in the box around.
const ON_PERSON: f64 = 0.8;
/// Maximum number of draws to find a pixel in the box but off the person: enough to find one in a
/// hundredth of the image almost surely. If none is found, the patch is centred on the person.
const TRIES: usize = 1024;

/// Draws `count` patches of `size`² pixels inside the image of a body in `pose`, and a random
/// background, by which the model distinguishes dark cloth from empty space.
pub(crate) fn draw(
    frame: &Picture,
    camera: &Camera,
    pose: &Pose,
    body: &CanonicalBody,
    count: usize,
    size: usize,
    rng: &mut impl RngExt,
) -> Batch {
    let (width, height) = (frame.image.width, frame.image.height);
    let body_view = BodyView::new(&body.skeleton, pose, camera);
    let ray = |x: usize, y: usize| body_view.ray(x as f64 + 0.5, y as f64 + 0.5);
    let background: [f32; 3] = std::array::from_fn(|_| rng.random());
    let mut batch = Batch {
        rays: Vec::with_capacity(count * size * size),
        patch_size: size,
        truth: Vec::with_capacity(count * size * size * 3),
        coverage: Vec::with_capacity(count * size * size),
        background,
    };
    for _ in 0..count {
        let on_person = !frame.covered.is_empty() && rng.random_bool(ON_PERSON);
        let mut centre = None;
        if !on_person {
            centre = (0..TRIES)
                .map(|_| rng.random_range(0..width * height))
                .find(|p| frame.image.mask[*p] == 0 && ray(p % width, p / width).is_some());
        }
        let centre = centre.unwrap_or_else(|| match frame.covered.len() {
            0 => rng.random_range(0..width * height),
            n => frame.covered[rng.random_range(0..n)] as usize,
        });
        let start = |c: usize, side: usize| c.saturating_sub(size / 2).min(side - size);
        let (x0, y0) = (start(centre % width, width), start(centre / width, height));
        for i in 0..size * size {
            let (x, y) = (x0 + i % size, y0 + i / size);
            let p = y * width + x;
            batch.rays.push(ray(x, y));
            let coverage = f32::from(frame.image.mask[p]) / 255.0;
            let clear = 1.0 - coverage;
            batch.coverage.push(coverage);
            batch
                .truth
                .extend((0..3).map(|c| {
                    f32::from(frame.image.rgb[3 * p + c]) / 255.0 + clear * background[c]
                }));
        }
    }
    batch
}
