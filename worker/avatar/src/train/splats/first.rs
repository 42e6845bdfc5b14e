//! The initial splats of a person: flat on the shell of the hull, in the mean colour of the frames that face
//! them.

use crate::field::splats::SplatValues;
use crate::train::TrainError;
use crate::train::people::{TrainFrame, TrainSubject};
use crate::train::splats::hull::{HullFrame, HullFrames, Shell, Sighting};
use yoto_capture::camera::Pose;
use yoto_ops::warp::inverse::solve::apply;

/// Standard deviations along the surface and across it, as shares of the distance between splats.
const FLAT: [f64; 3] = [0.6, 0.6, 0.25];
/// Cosine between normal and view above which a splat's pixel has its colour.
const FACING: f32 = 0.3;
/// Coverage of pixels that have no background in them.
const WHOLE: u8 = 250;
/// Colour of splats that no frame faces.
const UNSEEN: f32 = 0.4;

/// `count` splats for `subject`, from the frames that have a `pose`.
///
/// # Errors
/// If too few points of the body are on the person in the required number of frames.
pub(crate) fn initial_splats(
    subject: &TrainSubject,
    pose: impl Fn(&TrainFrame) -> Option<Pose>,
    count: usize,
) -> Result<SplatValues, TrainError> {
    let hull = HullFrames::new(subject, pose)?;
    let shell = hull.shell_of(count)?;
    let cells = shell.normals.len();
    if cells == 0 {
        return Err(TrainError::People(format!(
            "{}: poses and masks do not agree: no point of the body is inside the masks of its frames; \
             `yoto capture check` shows them together, and tiers without splats, such as fast, need no agreement",
            subject.name
        )));
    }
    // Cells at equal steps; their order is that of space, so that all parts of the body are thinned
    // alike. A hull that is too small gives some of its cells twice.
    let chosen: Vec<usize> = (0..count).map(|i| i * cells / count).collect();
    let apart = shell.spacing * (cells as f64 / count as f64).sqrt();
    let scale = FLAT.map(|share| (share * apart).ln() as f32);
    Ok(SplatValues {
        means: chosen.iter().flat_map(|i| shell.points[*i]).collect(),
        rotations: chosen
            .iter()
            .flat_map(|i| rotation_to(shell.normals[*i]))
            .collect(),
        scales: scale.repeat(count),
        opacities: vec![0.0; count],
        colours: colours(&hull, &shell, &chosen),
    })
}

/// The quaternion of the shortest rotation of the third axis to the unit vector `n`.
fn rotation_to([x, y, z]: [f32; 3]) -> [f32; 4] {
    // Where n is the opposite, any rotation by π across it will do.
    if z < -0.999_9 {
        return [0.0, 1.0, 0.0, 0.0];
    }
    let length = (2.0 + 2.0 * z).sqrt();
    [1.0 + z, -y, x, 0.0].map(|q| q / length)
}

/// The mean colour of each chosen cell in the frames that face it, by how much they do.
fn colours(hull: &HullFrames<'_>, shell: &Shell, chosen: &[usize]) -> Vec<f32> {
    let points: Vec<[f32; 3]> = chosen.iter().map(|i| shell.points[*i]).collect();
    let mut sums = vec![[0f32; 4]; chosen.len()];
    for frame in &hull.frames {
        let sightings = hull.sightings(&points, frame);
        for ((i, sum), sighting) in chosen.iter().zip(&mut sums).zip(sightings) {
            let at = [shell.points[*i], shell.normals[*i]];
            let Some((pixel, facing)) = faces(frame, sighting, at) else {
                continue;
            };
            let colour = &frame.image.rgb[3 * pixel..3 * pixel + 3];
            for (sum, value) in sum.iter_mut().zip(colour) {
                *sum += facing * f32::from(*value) / 255.0;
            }
            sum[3] += facing;
        }
    }
    sums.iter()
        .flat_map(|[r, g, b, weight]| match *weight > 0.0 {
            true => [r, g, b].map(|sum| sum / weight),
            false => [UNSEEN; 3],
        })
        .collect()
}

/// The pixel of a point with a normal, and the cosine to the view, if the frame shows it from the front.
fn faces(
    frame: &HullFrame,
    sighting: Sighting,
    [point, normal]: [[f32; 3]; 2],
) -> Option<(usize, f32)> {
    let pixel = sighting
        .pixel
        .filter(|pixel| frame.image.mask[*pixel] >= WHOLE)?;
    let t = &sighting.transform;
    let position = apply(t, point);
    let rotated: [f32; 3] = std::array::from_fn(|r| (0..3).map(|c| t[4 * r + c] * normal[c]).sum());
    let in_camera: [f32; 3] = std::array::from_fn(|r| {
        let row = frame.camera[r];
        row[0] * position[0] + row[1] * position[1] + row[2] * position[2] + row[3]
    });
    let normal: [f32; 3] =
        std::array::from_fn(|r| (0..3).map(|c| frame.camera[r][c] * rotated[c]).sum());
    let length = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
    let along: f32 = (0..3).map(|a| in_camera[a] * normal[a]).sum();
    let facing = -along / (length(in_camera) * length(normal));
    (facing > FACING).then_some((pixel, facing))
}
