//! The initial splats of a person: flat on their surface, in the mean colour of the frames that face them. The surface is that of
//! the shared body in the person's shape, with the shell of the hull where it stands off; of a skeleton that the body lacks, it is
//! the shell alone.

use crate::config::SplatConfig;
use crate::field::splats::SplatValues;
use crate::train::TrainError;
use crate::train::people::{TrainFrame, TrainSubject};
use crate::train::splats::hull::{HullFrames, Shell};
use crate::train::splats::paint::paint;
use crate::train::splats::surface::points::{SurfacePoints, thinned};
use crate::train::splats::surface::{PersonSurface, layer};
use tracing::debug;
use yoto_body::Body;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::smpl::has_joints;

/// Standard deviations along the surface and across it, as shares of the distance between splats.
const FLAT: [f64; 3] = [0.6, 0.6, 0.25];
/// Colour of splats that no frame faces.
const UNSEEN: f32 = 0.4;
/// Splats per area where no frame faces the surface, as a share of those elsewhere.
const UNSEEN_DENSITY: f64 = 0.25;
/// Fewest points of the body that are compared with masks and hull, one centimetre apart.
const SAMPLED: usize = 20_000;
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
    let (first, colours) = match config.surface && has_joints(skeleton) {
        true => {
            let person = PersonSurface::new(Body::people(), skeleton, &hull);
            on_body(&hull, &person, &shell, count)
        }
        false => {
            let first = on_shell(&shell, count);
            let colours = paint(&hull, &first);
            (first, colours)
        }
    };
    let colours = (colours.into_iter()).flat_map(|colour| colour.unwrap_or([UNSEEN; 3]));
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
        colours: colours.collect(),
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

/// `count` points and their colours: those of the person's body that the masks do not contradict, and those of the shell that no such
/// point is near.
fn on_body(
    hull: &HullFrames<'_>,
    person: &PersonSurface,
    shell: &Shell,
    count: usize,
) -> (SurfacePoints, Vec<Option<[f32; 3]>>) {
    let sampled = count.max(SAMPLED);
    let (own, area) = person.points(sampled);
    let inside: Vec<[f32; 3]> = (own.points.iter().zip(&own.normals))
        .map(|(at, normal)| std::array::from_fn(|a| at[a] - INSET * normal[a]))
        .collect();
    let kept = hull.hold(&inside, &own.skinning, shell);
    let beside = layer::beside(&own, &kept, shell, &hull.frames);
    let [own_colours, colours_beside] = [&own, &beside].map(|points| paint(hull, points));
    // Each part has splats by its area. The body has fewer where no frame shows it. A hull is deeper than the person there, and
    // has none.
    let density = |i: usize| match (kept[i], own_colours[i].is_some()) {
        (false, _) => 0.0,
        (true, true) => 1.0,
        (true, false) => UNSEEN_DENSITY,
    };
    let density_beside = |i: usize| f64::from(u8::from(colours_beside[i].is_some()));
    let each = area / sampled as f64;
    let cell = shell.spacing * shell.spacing;
    let own_area = each * (0..own.points.len()).map(density).sum::<f64>();
    let points_beside = (0..beside.points.len()).map(density_beside).sum::<f64>();
    let share = cell * points_beside / (own_area + cell * points_beside).max(f64::MIN_POSITIVE);
    let others = ((share * count as f64) as usize).min(points_beside as usize);
    debug!(
        held = kept.iter().filter(|kept| **kept).count(),
        beside = points_beside,
        others,
        "surface"
    );
    let (chosen, spacing) = thinned(own.points.len(), density, count - others, each);
    let (chosen_beside, spacing_beside) =
        thinned(beside.points.len(), density_beside, others, cell);
    let mut all = own.chosen(&chosen, spacing);
    all.append(beside.chosen(&chosen_beside, spacing_beside));
    let colours = chosen.iter().map(|i| own_colours[*i]);
    let colours = colours.chain(chosen_beside.iter().map(|i| colours_beside[*i]));
    (all, colours.collect())
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
