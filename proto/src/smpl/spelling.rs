//! The spellings of SMPL's joints in files of other programs.
//!
//! One word may stand for several joints: a `LeftFoot` is the ankle for most animation programs and
//! the foot for SMPL's own; only the position in the tree tells which.

/// Prefixes that rigs put before every name.
const RIGS: [&str; 6] = ["mixamorig", "bip001", "bip01", "mavg", "favg", "def"];

/// A joint's side of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    Middle,
}

/// Whether a joint with this `name` may be the one that [`JOINTS`](super::JOINTS) calls `joint`. Case,
/// separators, the prefix of a rig, and the form of the side (`l_`, `Left`, `.L`) don't matter.
pub(super) fn may_be(name: &str, joint: &str) -> bool {
    let (side, part) = match joint.split_once('_') {
        Some(("l", part)) => (Side::Left, part),
        Some(("r", part)) => (Side::Right, part),
        _ => (Side::Middle, joint),
    };
    let words = words_for(part);
    readings(&plain(name)).any(|(found, word)| found == side && words.contains(&word))
}

/// Lower-case letters and digits of `name`, without the prefix of a rig.
fn plain(name: &str) -> String {
    let short = name.rsplit(':').next().unwrap_or(name);
    let letters = short.chars().filter(char::is_ascii_alphanumeric);
    let plain: String = letters.map(|c| c.to_ascii_lowercase()).collect();
    let rest = RIGS.iter().find_map(|rig| plain.strip_prefix(rig));
    match rest {
        Some(rest) if !rest.is_empty() => rest.to_owned(),
        _ => plain,
    }
}

/// Each way to read a plain name as a side and a word.
fn readings(plain: &str) -> impl Iterator<Item = (Side, &str)> {
    let marks = [
        ("left", Side::Left),
        ("right", Side::Right),
        ("l", Side::Left),
        ("r", Side::Right),
    ];
    let sided = marks.into_iter().flat_map(move |(mark, side)| {
        let ends = [plain.strip_prefix(mark), plain.strip_suffix(mark)];
        ends.into_iter().flatten().map(move |word| (side, word))
    });
    sided.chain([(Side::Middle, plain)])
}

/// The words for a joint without its side.
fn words_for(part: &str) -> &'static [&'static str] {
    match part {
        "pelvis" => &["pelvis", "hips", "hip", "root"],
        "hip" => &["hip", "upleg", "thigh", "upperleg"],
        "spine1" => &[
            "spine1",
            "spine01",
            "spine",
            "spine0",
            "lowerback",
            "abdomen",
            "tospine",
            "torso",
            "chest",
        ],
        "knee" => &["knee", "leg", "lowleg", "lowerleg", "shin", "calf"],
        "spine2" => &["spine2", "spine02", "spine1", "spine", "chest", "chest2"],
        "ankle" => &["ankle", "foot"],
        "spine3" => &[
            "spine3",
            "spine03",
            "spine2",
            "spine1",
            "chest",
            "chest2",
            "chest3",
            "upperchest",
        ],
        "foot" => &["foot", "toe", "toes", "toebase", "ball"],
        "neck" => &["neck", "neck1", "neck01"],
        "collar" => &["collar", "clavicle", "shoulder", "innershoulder"],
        "head" => &["head"],
        "shoulder" => &["shoulder", "arm", "uparm", "upperarm", "shldr"],
        "elbow" => &["elbow", "forearm", "lowarm", "lowerarm"],
        "wrist" => &["wrist", "hand"],
        "hand" => &[
            "hand",
            "fingerbase",
            "fingers",
            "handmiddle1",
            "middle1",
            "handindex1",
            "index1",
        ],
        _ => &[],
    }
}

#[cfg(test)]
mod tests {
    use super::super::JOINTS;
    use super::*;

    #[test]
    fn a_side_is_told_in_many_ways() {
        for name in [
            "l_hip",
            "left_hip",
            "L_Hip",
            "LeftUpLeg",
            "lHip",
            "LHip",
            "LHIP",
            "leftHip",
            "thigh_l",
            "Thigh.L",
            "mixamorig:LeftUpLeg",
            "mixamorig_LeftUpLeg",
            "m_avg_L_Hip",
            "Bip01 L Thigh",
            "DEF-thigh.L",
        ] {
            assert!(may_be(name, "l_hip"), "{name}");
            assert!(!may_be(name, "r_hip"), "{name}");
            assert!(!may_be(name, "pelvis") && !may_be(name, "l_knee"), "{name}");
        }
        for name in ["hip_from_nowhere", "", ":", "left", "ländler", "Prop"] {
            assert!(
                JOINTS.iter().all(|(joint, _)| !may_be(name, joint)),
                "{name}"
            );
        }
    }

    #[test]
    fn every_joint_has_its_own_name_among_its_words() {
        for (joint, _) in JOINTS {
            assert!(may_be(joint, joint), "{joint}");
        }
    }
}
