//! One spelling for SMPL's skeleton, so that people whose files name the same joints in different
//! ways can be trained together.

use super::JOINTS;
use super::spelling::Spelled;
use crate::pose_track::{PoseTrack, Skeleton};

/// Renames and reorders the joints of a track with SMPL's joint tree, in its skeleton and poses, to the names
/// and order of [`JOINTS`]. Returns a note for people. A track that has these already, or has another tree or
/// unknown names, is not changed, and the result is `None`.
///
/// The track must be valid.
pub fn unify(track: &mut PoseTrack) -> Option<String> {
    let skeleton = &track.skeleton;
    if skeleton.parents.len() != JOINTS.len() || is_canonical(skeleton) {
        return None;
    }
    let mut indices = [0; JOINTS.len()];
    let names = Spelled::all(&skeleton.names);
    if !matched(skeleton, &names, 0, 0, &mut indices) {
        return None;
    }
    let reordered = indices
        .iter()
        .enumerate()
        .any(|(joint, index)| joint != *index);
    let other = |&(joint, index): &(usize, usize)| {
        let (name, (own, _)) = (skeleton.names.get(index), JOINTS.get(joint)?);
        name.filter(|name| name != own).map(|name| (own, name))
    };
    let renamed: Vec<_> = indices
        .into_iter()
        .enumerate()
        .filter_map(|it| other(&it))
        .collect();
    let names = renamed.first().map(|(own, name)| {
        let count = renamed.len();
        format!(
            "{count} of the {} joints have SMPL's names now, such as {own} for '{name}'",
            JOINTS.len()
        )
    });
    let order = reordered.then(|| "the joints are in SMPL's order now".to_owned());
    let said: Vec<String> = names.into_iter().chain(order).collect();
    let rest_joints = indices
        .iter()
        .filter_map(|&index| skeleton.rest_joints.get(index));
    let rest_joints = rest_joints.copied().collect();
    let parent = |parent: Option<usize>| parent.map_or(-1, |parent| parent as i32);
    track.skeleton = Skeleton {
        names: JOINTS.iter().map(|(name, _)| (*name).to_owned()).collect(),
        parents: JOINTS.iter().map(|(_, above)| parent(*above)).collect(),
        rest_joints,
    };
    for frame in &mut track.frames {
        let joints = frame.pose.as_chunks::<3>().0;
        let pose = indices.iter().filter_map(|&index| joints.get(index));
        frame.pose = pose.flatten().copied().collect();
    }
    Some(format!(
        "{}: people with this joint hierarchy can be trained together",
        said.join("; ")
    ))
}

fn is_canonical(skeleton: &Skeleton) -> bool {
    let parents = skeleton.parents.iter();
    let mut table = JOINTS.iter().zip(&skeleton.names).zip(parents);
    table.all(|(((name, above), found), &parent)| {
        name == found && usize::try_from(parent).ok() == *above
    })
}

/// With the joints' `names`, whether the skeleton's joint `index` and all joints below it may be SMPL's `joint` and all joints below that.
/// Writes the skeleton's index of each SMPL joint to `indices`.
fn matched(
    skeleton: &Skeleton,
    names: &[Spelled],
    index: usize,
    joint: usize,
    indices: &mut [usize; JOINTS.len()],
) -> bool {
    let (Some(name), Some((own, _)), Some(to)) =
        (names.get(index), JOINTS.get(joint), indices.get_mut(joint))
    else {
        return false;
    };
    if !name.may_be(own) {
        return false;
    }
    *to = index;
    let below: Vec<usize> = (0..JOINTS.len())
        .filter(|&it| {
            JOINTS
                .get(it)
                .is_some_and(|(_, above)| *above == Some(joint))
        })
        .collect();
    let mut found: Vec<usize> = (0..skeleton.parents.len())
        .filter(|&it| skeleton.parents.get(it).copied() == i32::try_from(index).ok())
        .collect();
    // No word stands for two children of the same joint, so the first match is the only one.
    below.len() == found.len()
        && below.into_iter().all(|joint| {
            let fits = found
                .iter()
                .position(|&it| matched(skeleton, names, it, joint, indices));
            fits.map(|at| found.swap_remove(at)).is_some()
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose_track::{Frame, NO_DISTORTION};

    const MIXAMO: [&str; 24] = [
        "mixamorig:Hips",
        "mixamorig:LeftUpLeg",
        "mixamorig:RightUpLeg",
        "mixamorig:Spine",
        "mixamorig:LeftLeg",
        "mixamorig:RightLeg",
        "mixamorig:Spine1",
        "mixamorig:LeftFoot",
        "mixamorig:RightFoot",
        "mixamorig:Spine2",
        "mixamorig:LeftToeBase",
        "mixamorig:RightToeBase",
        "mixamorig:Neck",
        "mixamorig:LeftShoulder",
        "mixamorig:RightShoulder",
        "mixamorig:Head",
        "mixamorig:LeftArm",
        "mixamorig:RightArm",
        "mixamorig:LeftForeArm",
        "mixamorig:RightForeArm",
        "mixamorig:LeftHand",
        "mixamorig:RightHand",
        "mixamorig:LeftHandMiddle1",
        "mixamorig:RightHandMiddle1",
    ];
    /// SMPL's joints by their index in a file that goes down each limb before the next.
    const DEPTH_FIRST: [usize; 24] = [
        0, 3, 6, 9, 14, 17, 19, 21, 23, 13, 16, 18, 20, 22, 12, 15, 2, 5, 8, 11, 1, 4, 7, 10,
    ];

    /// SMPL's joints in `order`, called `name`; the numbers tell the joint.
    fn track(order: &[usize], name: impl Fn(usize) -> String) -> PoseTrack {
        let index = |joint| order.iter().position(|it| *it == joint);
        let parent = |&joint: &usize| match JOINTS[joint].1 {
            Some(above) => index(above).expect("is in the order") as i32,
            None => -1,
        };
        let rest = |&joint: &usize| [joint as f64, 0.0, 1.0];
        PoseTrack {
            skeleton: Skeleton {
                names: order.iter().map(|&joint| name(joint)).collect(),
                parents: order.iter().map(parent).collect(),
                rest_joints: order.iter().map(rest).collect(),
            },
            image_size: [8, 8],
            fps: 15.0,
            distortion: NO_DISTORTION,
            frames: vec![Frame {
                index: 4,
                pose: order
                    .iter()
                    .flat_map(|&j| [0.1 * j as f64, 0.0, 0.5])
                    .collect(),
                translation: [1.0, 2.0, 3.0],
                k: [[9.0, 0.0, 4.0], [0.0, 9.0, 4.0], [0.0, 0.0, 1.0]],
                e: std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j))),
            }],
        }
    }

    fn own(joint: usize) -> String {
        JOINTS[joint].0.to_owned()
    }

    fn in_order() -> Vec<usize> {
        (0..24).collect()
    }

    #[test]
    fn other_names_become_smpls_and_nothing_else_changes() {
        let canonical = track(&in_order(), own);
        let long = |joint| {
            let name = own(joint);
            let name = name.replace("l_", "left_");
            name.replace("r_", "right_")
        };
        let capital = |joint| {
            let name = own(joint);
            let mut parts = name
                .split('_')
                .map(|part| part[..1].to_uppercase() + &part[1..]);
            let first = parts.next().expect("a part");
            parts.fold(first, |all, part| all + "_" + &part)
        };
        let mixamo = |joint: usize| MIXAMO[joint].to_owned();
        for mut other in [
            track(&in_order(), long),
            track(&in_order(), capital),
            track(&in_order(), mixamo),
        ] {
            assert_eq!(other.check(), []);
            let note = unify(&mut other).expect("SMPL's tree");
            assert!(
                note.contains("SMPL's names") && !note.contains("order"),
                "{note}"
            );
            assert_eq!(other, canonical);
        }
    }

    #[test]
    fn another_order_takes_poses_and_rest_joints_along() {
        let canonical = track(&in_order(), own);
        let mut other = track(&DEPTH_FIRST, |joint| MIXAMO[joint].to_owned());
        assert_eq!(other.check(), []);
        let note = unify(&mut other).expect("SMPL's tree");
        assert!(
            note.contains("SMPL's names") && note.contains("order"),
            "{note}"
        );
        assert_eq!(other, canonical);
        let mut own_names = track(&DEPTH_FIRST, own);
        let note = unify(&mut own_names).expect("SMPL's tree");
        assert!(
            !note.contains("SMPL's names") && note.contains("order"),
            "{note}"
        );
        assert_eq!(own_names, canonical);
    }

    #[test]
    fn other_trees_and_other_names_stay() {
        let same = |mut track: PoseTrack| {
            let before = track.clone();
            assert_eq!(unify(&mut track), None);
            assert_eq!(track, before);
        };
        same(track(&in_order(), own));
        same(track(&in_order(), |joint| format!("joint{joint}")));
        // A hand for the root's child: SMPL's names over another tree.
        let mut moved = track(&in_order(), own);
        moved.skeleton.parents[22] = 0;
        same(moved);
        // Left and right exchanged in one limb.
        let mut crossed = track(&in_order(), own);
        crossed.skeleton.names.swap(4, 5);
        same(crossed);
        let mut short = track(&in_order(), own);
        short.skeleton.names.pop();
        short.skeleton.parents.pop();
        short.skeleton.rest_joints.pop();
        short.frames[0].pose.truncate(69);
        same(short);
    }
}
