//! The spellings of SMPL's joints in files of other programs.
//!
//! One word may stand for several joints: a `LeftFoot` is the ankle for most animation programs and
//! the foot for SMPL's own; only the position in the tree tells which.

/// Prefixes that rigs put before every name.
const RIGS: [&str; 10] = [
    "mixamorig",
    "bip001",
    "bip01",
    "mavg",
    "favg",
    "def",
    "org",
    "ccbase",
    "jbip",
    "character1",
];
/// Least share of a file's names that begin alike where that is a prefix of the rig's.
const SHARED: f64 = 0.6;
/// What sides are called between separators.
const SIDES: [&str; 5] = ["l", "r", "c", "left", "right"];
/// Fewest names that tell a prefix.
const FEWEST: usize = 4;
/// What Rigify calls the joints of the back, from the pelvis up: one chain of numbers, with the head at the end.
const RIGIFY: [(&str, &str); 6] = [
    ("spine", "pelvis"),
    ("spine001", "spine1"),
    ("spine002", "spine2"),
    ("spine003", "spine3"),
    ("spine004", "neck"),
    ("spine006", "head"),
];

/// A joint's side of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    Middle,
}

/// A joint's name without what does not tell which joint it is: case, separators, the prefix of a rig.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spelled(String);

impl Spelled {
    /// The names of all joints of a file. A prefix that most of them share, up to a separator, is the rig's.
    pub fn all(names: &[String]) -> Vec<Self> {
        let prefix = shared_prefix(names);
        let plain = names
            .iter()
            .map(|name| plain(name.strip_prefix(&*prefix).unwrap_or(name)));
        let mut plain: Vec<String> = plain.collect();
        if RIGIFY
            .iter()
            .all(|(name, _)| plain.iter().any(|it| it == name))
        {
            for name in &mut plain {
                if let Some((_, joint)) = RIGIFY.iter().find(|(other, _)| other == name) {
                    (*joint).clone_into(name);
                }
            }
        }
        plain.into_iter().map(Self).collect()
    }

    /// A name alone.
    pub fn of(name: &str) -> Self {
        Self(plain(name))
    }

    /// Whether `other` may be another form of the same name: `LeftUpLeg`, `upleg.L`.
    pub fn agrees(&self, other: &Self) -> bool {
        readings(&self.0).any(|one| readings(&other.0).any(|it| it == one))
    }

    /// Whether this may be the joint that [`JOINTS`](super::JOINTS) calls `joint`. The form of the side (`l_`, `Left`,
    /// `.L`) does not matter.
    pub(super) fn may_be(&self, joint: &str) -> bool {
        let (side, part) = match joint.split_once('_') {
            Some(("l", part)) => (Side::Left, part),
            Some(("r", part)) => (Side::Right, part),
            _ => (Side::Middle, joint),
        };
        let words = words_for(part);
        readings(&self.0).any(|(found, word)| found == side && words.contains(&word))
    }
}

/// The longest prefix, up to a separator, with which most of `names` begin; empty if there is none.
fn shared_prefix(names: &[String]) -> String {
    let mut longest = "";
    if names.len() < FEWEST {
        return String::new();
    }
    for name in names {
        for (at, separator) in name
            .char_indices()
            .filter(|(_, c)| !c.is_ascii_alphanumeric())
        {
            let prefix = name.get(..at + separator.len_utf8()).unwrap_or_default();
            let last = name.get(..at).unwrap_or_default();
            let last = last.rsplit(|c: char| !c.is_ascii_alphanumeric()).next();
            // A side is no part of the prefix.
            if last.is_some_and(|last| SIDES.contains(&&*last.to_ascii_lowercase())) {
                continue;
            }
            let sharing = names
                .iter()
                .filter(|other| {
                    // A number alone is no name.
                    let rest = other.strip_prefix(prefix);
                    rest.is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_alphabetic()))
                })
                .count();
            if prefix.len() > longest.len() && sharing as f64 >= SHARED * names.len() as f64 {
                longest = prefix;
            }
        }
    }
    longest.to_owned()
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
        // VRM marks the middle.
        ("c", Side::Middle),
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
            let name = Spelled::of(name);
            assert!(name.may_be("l_hip"), "{name:?}");
            assert!(!name.may_be("r_hip"), "{name:?}");
            assert!(!name.may_be("pelvis") && !name.may_be("l_knee"), "{name:?}");
        }
        for name in ["hip_from_nowhere", "", ":", "left", "ländler", "Prop"] {
            assert!(
                JOINTS
                    .iter()
                    .all(|(joint, _)| !Spelled::of(name).may_be(joint)),
                "{name}"
            );
        }
    }

    #[test]
    fn every_joint_has_its_own_name_among_its_words() {
        for (joint, _) in JOINTS {
            assert!(Spelled::of(joint).may_be(joint), "{joint}");
        }
    }

    #[test]
    fn a_prefix_is_what_most_names_begin_with() {
        let all = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            let plain = Spelled::all(&names);
            plain.into_iter().map(|name| name.0).collect::<Vec<_>>()
        };
        let prefixed = [
            "f_mosh_05_Pelvis",
            "f_mosh_05_L_Hip",
            "f_mosh_05_R_Hip",
            "f_mosh_05_Head",
            "Prop",
        ];
        assert_eq!(all(&prefixed), ["pelvis", "lhip", "rhip", "head", "prop"]);
        // Too few begin alike.
        let sides = ["L_Hip", "L_Knee", "R_Hip", "R_Knee"];
        assert_eq!(all(&sides), ["lhip", "lknee", "rhip", "rknee"]);
        // A side that most have in a part of a rig is none.
        let left = ["J_L_Hip", "J_L_Knee", "J_L_Foot", "J_C_Hips"];
        assert_eq!(all(&left), ["lhip", "lknee", "lfoot", "chips"]);
        let rigify = [
            "spine",
            "spine.001",
            "spine.002",
            "spine.003",
            "spine.004",
            "spine.005",
            "spine.006",
            "thigh.L",
        ];
        assert_eq!(
            all(&rigify),
            [
                "pelvis", "spine1", "spine2", "spine3", "neck", "spine005", "head", "thighl"
            ]
        );
        assert!(Spelled::of("LeftUpLeg").agrees(&Spelled::of("upleg.L")));
        assert!(!Spelled::of("LeftUpLeg").agrees(&Spelled::of("RightUpLeg")));
        assert!(Spelled::of("J_Bip_C_Hips").agrees(&Spelled::of("Hips")));
    }
}
