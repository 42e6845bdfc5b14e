//! The initial splats of a person: flat on their surface, in the mean colour of the frames that face them. The surface is that of
//! the shared body in the person's shape, with the shell of the hull where it stands off; of a skeleton that the body lacks, it is
//! the shell alone.

use crate::config::SplatConfig;
use crate::field::splats::SplatValues;
use crate::train::TrainError;
use crate::train::people::{TrainFrame, TrainSubject};
use crate::train::splats::hull::{HullFrame, HullFrames, Shell, Sighting};
use crate::train::splats::surface::points::SurfacePoints;
use crate::train::splats::surface::{PersonSurface, Skirt, layer};
use tracing::debug;
use yoto_body::Body;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::smpl::has_joints;
use yoto_ops::warp::inverse::solve::apply;

/// Standard deviations along the surface and across it, as shares of the distance between splats.
const FLAT: [f64; 3] = [0.6, 0.6, 0.25];
/// Cosine between normal and view above which a splat's pixel has its colour.
const FACING: f32 = 0.3;
/// Coverage of pixels that have no background in them.
const WHOLE: u8 = 250;
/// Colour of splats that no frame faces.
const UNSEEN: f32 = 0.4;
/// Splats per area where no frame faces the surface, as a share of those elsewhere.
const UNSEEN_DENSITY: f64 = 0.25;
/// How far outside of the masks a point of the body may be, metres.
const INSET: f32 = 0.008;

/// `count` splats for `subject`, from the frames that have a `pose`.
///
/// # Errors
/// If too few points of the body are on the person in the required number of frames.
pub(crate) fn initial_splats(
    subject: &TrainSubject,
    config: &SplatConfig,
    pose: impl Fn(&TrainFrame) -> Option<Pose>,
    count: usize,
) -> Result<SplatValues, TrainError> {
    let hull = HullFrames::new(subject, pose)?;
    let shell = hull.shell_of(count)?;
    if shell.normals.is_empty() {
        return Err(TrainError::People(format!(
            "{}: poses and masks do not agree: no point of the body is inside the masks of its frames; \
             `yoto capture check` shows them together, and tiers without splats, such as fast, need no agreement",
            subject.name
        )));
    }
    let skeleton = &subject.body.skeleton;
    let first = match config.surface && has_joints(skeleton) {
        true => {
            let person = PersonSurface::new(Body::people(), skeleton, &hull);
            on_body(&hull, &person, &shell, count)
        }
        false => on_shell(&shell, count),
    };
    let scales = first.spacing.iter();
    Ok(SplatValues {
        rotations: first
            .normals
            .iter()
            .copied()
            .flat_map(rotation_to)
            .collect(),
        scales: scales
            .flat_map(|apart| FLAT.map(|share| (share * apart).ln() as f32))
            .collect(),
        opacities: vec![0.0; first.points.len()],
        colours: colours(&hull, &first),
        skinning: first.skinning(),
        means: first.points.into_flattened(),
    })
}

/// `count` points of the shell.
fn on_shell(shell: &Shell, count: usize) -> SurfacePoints {
    let cells = shell.normals.len();
    // Cells at equal steps; their order is that of space, so that all parts of the body are thinned
    // alike. A hull that is too small gives some of its cells twice.
    let chosen: Vec<usize> = (0..count).map(|i| i * cells / count).collect();
    SurfacePoints {
        points: chosen.iter().map(|i| shell.points[*i]).collect(),
        normals: chosen.iter().map(|i| shell.normals[*i]).collect(),
        spacing: vec![shell.spacing * (cells as f64 / count as f64).sqrt(); count],
        skinning: Vec::new(),
    }
}

/// `count` points: those of the person's body that the masks do not contradict, and those of the shell that no such point is near.
fn on_body(
    hull: &HullFrames<'_>,
    person: &PersonSurface,
    shell: &Shell,
    count: usize,
) -> SurfacePoints {
    let (mut own, area) = person.points(count);
    let inside: Vec<[f32; 3]> = (own.points.iter().zip(&own.normals))
        .map(|(at, normal)| std::array::from_fn(|a| at[a] - INSET * normal[a]))
        .collect();
    let kept = hull.hold(&inside, &own.skinning, shell);
    let mut beside = layer::beside(&own, &kept, shell, &hull.frames);
    if let Some(skirt) = person.skirt {
        skirt.hang([&mut own, &mut beside]);
    }
    // Cloth between legs is stretched when they are apart.
    let stretch = |points: &SurfacePoints, i: usize| match person.skirt {
        Some(_) => Skirt::density(&points.skinning[i], count),
        None => 1.0,
    };
    let held = kept.iter().filter(|kept| **kept).count();
    // Each part has splats by its area, and fewer where no frame faces it.
    let shown = colour_sums(hull, &own);
    let density = |i: usize| match (kept[i], shown[i][3] > 0.0) {
        (false, _) => 0.0,
        (true, true) => stretch(&own, i),
        (true, false) => UNSEEN_DENSITY,
    };
    let density_beside = |i: usize| stretch(&beside, i);
    let each = area / count.max(1) as f64;
    let own_area = each * (0..own.points.len()).map(density).sum::<f64>();
    let cell = shell.spacing * shell.spacing;
    let area_beside = cell * (0..beside.points.len()).map(density_beside).sum::<f64>();
    let share = area_beside / (own_area + area_beside).max(f64::MIN_POSITIVE);
    let others = ((share * count as f64) as usize).min(beside.points.len());
    debug!(held, beside = beside.points.len(), others, "surface");
    let mut all = own.thinned(density, count - others, each);
    all.append(beside.thinned(density_beside, others, cell));
    all
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

/// The mean colour of each point in the frames that face it, by how much they do.
fn colours(hull: &HullFrames<'_>, first: &SurfacePoints) -> Vec<f32> {
    (colour_sums(hull, first).into_iter())
        .flat_map(|[r, g, b, weight]| match weight > 0.0 {
            true => [r, g, b].map(|sum| sum / weight),
            false => [UNSEEN; 3],
        })
        .collect()
}

/// Σ f c and Σ f of the colours c of each point in the frames that face it, where f is the cosine to the view.
fn colour_sums(hull: &HullFrames<'_>, first: &SurfacePoints) -> Vec<[f32; 4]> {
    let mut sums = vec![[0f32; 4]; first.points.len()];
    for frame in &hull.frames {
        let sightings = match first.skinning.as_slice() {
            [] => hull.sightings(&first.points, frame),
            skinning => hull.sightings_on_surface(&first.points, skinning, frame),
        };
        let points = first.points.iter().zip(&first.normals);
        for ((sum, sighting), (point, normal)) in sums.iter_mut().zip(sightings).zip(points) {
            let Some((pixel, facing)) = faces(frame, sighting, [*point, *normal]) else {
                continue;
            };
            let colour = &frame.image.rgb[3 * pixel..3 * pixel + 3];
            for (sum, value) in sum.iter_mut().zip(colour) {
                *sum += facing * f32::from(*value) / 255.0;
            }
            sum[3] += facing;
        }
    }
    sums
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
