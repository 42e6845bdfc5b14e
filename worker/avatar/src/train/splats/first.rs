//! The initial splats of a person: flat on their surface, in the mean colour of the frames that face them. The surface is that of
//! the shared body in the person's shape, with the shell of the hull where it stands off; of a skeleton that the body lacks, it is
//! the shell alone.

use crate::config::SplatConfig;
use crate::field::splats::SplatValues;
use crate::train::TrainError;
use crate::train::people::{TrainFrame, TrainSubject};
use crate::train::splats::hull::{HullFrames, Shell};
use crate::train::splats::shown::{colour_sums, faced, shown};
use crate::train::splats::surface::points::SurfacePoints;
use crate::train::splats::surface::{PersonSurface, Skirt, layer};
use tracing::debug;
use yoto_body::Body;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::smpl::has_joints;

/// Standard deviations along the surface and across it, as shares of the distance between splats.
const FLAT: [f64; 3] = [0.6, 0.6, 0.25];
/// Standard deviation across the surface where no frame faces it, metres. Nothing makes such splats thinner while others learn, and the
/// person would be as much thicker there.
const UNSEEN_ACROSS: f64 = 1e-3;
/// Colour of splats that no frame faces.
const UNSEEN: f32 = 0.4;
/// Splats per area where no frame faces the surface, as a share of those elsewhere.
const UNSEEN_DENSITY: f64 = 0.25;
/// How far outside of the masks a point of the body may be, metres.
const INSET: f32 = 0.008;

/// The initial splats of a person, and what their frames tell about the person.
pub(crate) struct InitialSplats {
    pub values: SplatValues,
    /// Whether the person's clothes are taken for a skirt or a coat.
    pub in_skirt: bool,
}

/// `count` splats for `subject`, from the frames that have a `pose`.
///
/// # Errors
/// If too few points of the body are on the person in the required number of frames.
pub(crate) fn initial_splats(
    subject: &TrainSubject,
    config: &SplatConfig,
    pose: impl Fn(&TrainFrame) -> Option<Pose>,
    count: usize,
) -> Result<InitialSplats, TrainError> {
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
    let person = (config.surface && has_joints(skeleton))
        .then(|| PersonSurface::new(Body::for_joints(skeleton.joints()), skeleton, &hull));
    let first = match &person {
        Some(person) => on_body(&hull, person, &shell, count),
        None => on_shell(&shell, count),
    };
    let values = SplatValues {
        rotations: first
            .normals
            .iter()
            .copied()
            .flat_map(rotation_to)
            .collect(),
        scales: scales(&first),
        opacities: vec![0.0; first.points.len()],
        colours: colours(&hull, &first),
        skinning: first.skinning(),
        means: first.points.into_flattened(),
    };
    Ok(InitialSplats {
        values,
        in_skirt: person.is_some_and(|person| person.skirt.is_some()),
    })
}

/// Logarithms of the deviations `[N, 3]` of a splat at each point.
fn scales(first: &SurfacePoints) -> Vec<f32> {
    let all = first.spacing.iter().zip(&first.sparse);
    all.flat_map(|(apart, sparse)| {
        let [along, beside, across] = FLAT.map(|share| share * apart);
        let across = if *sparse { UNSEEN_ACROSS } else { across };
        [along, beside, across].map(|deviation| deviation.ln() as f32)
    })
    .collect()
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
        sparse: vec![false; count],
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
    let each = area / count.max(1) as f64;
    let kept = hull.hold(&inside, &own.skinning, shell);
    let mut beside = layer::beside(&own, &kept, each.sqrt(), shell, &hull.frames);
    if let Some(skirt) = person.skirt {
        skirt.hang([&mut own, &mut beside]);
    }
    let [own_stretch, beside_stretch] = match person.skirt {
        Some(_) => stretch(hull, [&own, &beside], &kept, each.sqrt(), count),
        None => [&own, &beside].map(|part| vec![1.0; part.points.len()]),
    };
    let held = kept.iter().filter(|kept| **kept).count();
    // Each part has splats by its area, and fewer where no frame faces it.
    let own_faced = colour_sums(hull, &own);
    let density = |i: usize| match (kept[i], own_faced[i][3] > 0.0) {
        (false, _) => 0.0,
        (true, true) => own_stretch[i],
        (true, false) => UNSEEN_DENSITY,
    };
    // Where no frame tells how deep the person is, hulls reach far behind them, with wings beside the neck.
    let faced_beside = match shell.depth_unseen {
        true => faced(hull, &beside),
        false => vec![true; beside.points.len()],
    };
    let density_beside = |i: usize| match faced_beside[i] {
        true => beside_stretch[i],
        false => 0.0,
    };
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

/// How many times as dense splats are at each point of the two parts of a surface with a skirt, since cloth between legs is stretched when
/// they are apart. Where no frame shows the point, as inside of the cloth, they are as dense as elsewhere.
fn stretch(
    hull: &HullFrames<'_>,
    parts: [&SurfacePoints; 2],
    kept: &[bool],
    apart: f64,
    count: usize,
) -> [Vec<f64>; 2] {
    let shown = shown(hull, parts, kept, apart);
    std::array::from_fn(|part| {
        (parts[part].skinning.iter().zip(&shown[part]))
            .map(|(skinning, shown)| match shown {
                true => Skirt::density(skinning, count),
                false => 1.0,
            })
            .collect()
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

/// The mean colour of each point in the frames that face it, by how much they do.
fn colours(hull: &HullFrames<'_>, first: &SurfacePoints) -> Vec<f32> {
    (colour_sums(hull, first).into_iter())
        .flat_map(|[r, g, b, weight]| match weight > 0.0 {
            true => [r, g, b].map(|sum| sum / weight),
            false => [UNSEEN; 3],
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Splats that nothing teaches do not make the person thicker.
    #[test]
    fn splats_that_no_frame_faces_are_thin() {
        let first = SurfacePoints {
            spacing: vec![0.008, 0.016],
            sparse: vec![false, true],
            ..SurfacePoints::default()
        };
        let scales = scales(&first);
        let across = |i: usize| scales[3 * i + 2].exp();
        assert!((across(0) - 0.002).abs() < 1e-6, "{}", across(0));
        assert!((across(1) - 0.001).abs() < 1e-6, "{}", across(1));
        assert!(scales[3] > scales[0]);
    }
}
