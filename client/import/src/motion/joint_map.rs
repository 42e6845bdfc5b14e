//! The map from a motion's joints to a person's joints, by name.
//!
//! A map is JSON: `{"l_knee": ["LeftLeg", "LeftKnee"], …}`, each joint of the person with the names
//! that motions have for it. The first name that the motion has, and that no earlier joint took,
//! is used. A joint's own name always matches: before all others if the motion has it in the same
//! case, after them otherwise, since `Spine1` is `spine1` for few writers. Otherwise case does not
//! matter, nor separators, the form of a side (`LeftHand`, `hand_l`, `Hand.L`), or a prefix that a rig
//! puts before its names (`mixamorig:Hips`, `Bip01 L Hand`; [`Spelled`]).

use crate::ImportError;
use std::collections::HashSet;
use std::path::Path;
use yoto_proto::smpl::{FINGERS, Spelled};

/// The default map: names of CMU's conversions, Mixamo, HumanIK (MotionBuilder), Unity, VRM, Unreal, Rigify, 3ds Max's
/// Biped, Poser, Daz, Kinect, Xsens, Bandai-Namco and SMPL itself. `yoto motion --write-map` writes it for editing.
pub const DEFAULT: &str = include_str!("joint_map.json");

/// Joints of a hand that a rig with fingers has at least, of fifteen. CMU's conversions have a thumb and an index finger alone.
const FEWEST_OF_A_HAND: usize = 8;

/// Joints of a person, each with the names that motions have for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointMap(Vec<(String, Vec<String>)>);

impl JointMap {
    /// The map of a file, or the default.
    ///
    /// # Errors
    /// When the file can't be read or is not a map.
    pub fn open(path: Option<&Path>) -> Result<Self, ImportError> {
        let Some(path) = path else {
            return Self::parse(DEFAULT).map_err(ImportError::Unusable);
        };
        let text = std::fs::read_to_string(path).map_err(ImportError::file("reading", path))?;
        Self::parse(&text)
            .map_err(|message| ImportError::Unusable(format!("{}: {message}", path.display())))
    }

    fn parse(text: &str) -> Result<Self, String> {
        use serde_json::Value as Json;
        let json: Json = serde_json::from_str(text).map_err(|error| error.to_string())?;
        let Json::Object(entries) = json else {
            return Err("a joint map is {\"joint\": [\"name\", …], …}".into());
        };
        let names = |(joint, names): (String, Json)| {
            let list = match names {
                Json::String(name) => vec![name],
                other => serde_json::from_value(other)
                    .map_err(|_| format!("{joint}: neither a name nor a list of names"))?,
            };
            Ok((joint, list))
        };
        let mut map: Vec<_> = entries
            .into_iter()
            .map(names)
            .collect::<Result<_, String>>()?;
        // Joints choose in the order of SMPL's table, from the root outwards.
        let index = |joint: &str| {
            let table = yoto_proto::smpl::JOINTS.iter();
            table.clone().position(|(name, _)| *name == joint)
        };
        map.sort_by_key(|(joint, _)| index(joint).unwrap_or(usize::MAX));
        Ok(Self(map))
    }

    /// For each joint of the map that `names` has, the joint and the index of its name.
    pub fn matches(&self, names: &[String]) -> Vec<(String, usize)> {
        let known = Spelled::all(names);
        let choose = |joints: &mut dyn Iterator<Item = &(String, Vec<String>)>,
                      taken: &mut HashSet<usize>| {
            let mut found = Vec::new();
            for (joint, wanted) in joints {
                let own = names.iter().position(|name| name == joint);
                let index = own.filter(|at| !taken.contains(at)).or_else(|| {
                    wanted.iter().chain([joint]).find_map(|wanted| {
                        let wanted = Spelled::of(wanted);
                        let agrees =
                            |at: &usize| known.get(*at).is_some_and(|it| it.agrees(&wanted));
                        (0..known.len()).find(|at| agrees(at) && !taken.contains(at))
                    })
                });
                if let Some(index) = index {
                    taken.insert(index);
                    found.push((joint.clone(), index));
                }
            }
            found
        };
        // Fingers choose first: in a rig without them, the hand's joint may have the name of one.
        let (mut taken, mut fingers) = (HashSet::new(), Vec::new());
        for side in ["l_", "r_"] {
            let mut with_hand = taken.clone();
            let mut of_hand = self
                .0
                .iter()
                .filter(|(joint, _)| is_finger(joint) && joint.starts_with(side));
            let hand = choose(&mut of_hand, &mut with_hand);
            if hand.len() >= FEWEST_OF_A_HAND {
                taken = with_hand;
                fingers.extend(hand);
            }
        }
        let mut body = self.0.iter().filter(|(joint, _)| !is_finger(joint));
        let mut found = choose(&mut body, &mut taken);
        // A shoulder without an arm is the shoulder.
        for [collar, shoulder] in [["l_collar", "l_shoulder"], ["r_collar", "r_shoulder"]] {
            let has_shoulder = found.iter().any(|(joint, _)| joint == shoulder);
            let alone = found
                .iter_mut()
                .find(|(joint, _)| joint == collar && !has_shoulder);
            if let Some((joint, _)) = alone {
                shoulder.clone_into(joint);
            }
        }
        found.extend(fingers);
        found
    }
}

fn is_finger(joint: &str) -> bool {
    FINGERS.iter().any(|(name, _)| *name == joint)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matched(names: &[&str]) -> Vec<String> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let map = JointMap::parse(DEFAULT).expect("the usual map");
        let pair = |(joint, at): (String, usize)| format!("{joint}={}", names[at]);
        map.matches(&names).into_iter().map(pair).collect()
    }

    #[test]
    fn the_same_name_means_what_its_writer_meant() {
        // CMU's conversions have three joints for SMPL's three under other names than Mixamo.
        assert_eq!(
            matched(&["Hips", "LowerBack", "Spine", "Spine1"]),
            [
                "pelvis=Hips",
                "spine1=LowerBack",
                "spine2=Spine",
                "spine3=Spine1"
            ]
        );
        assert_eq!(
            matched(&["mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Spine2"]),
            [
                "spine1=mixamorig:Spine",
                "spine2=mixamorig:Spine1",
                "spine3=mixamorig:Spine2"
            ]
        );
        // A shoulder is a collar where there is an arm, and a shoulder where there is a collar.
        assert_eq!(
            matched(&["LeftShoulder", "LeftArm"]),
            ["l_collar=LeftShoulder", "l_shoulder=LeftArm"]
        );
        assert_eq!(
            matched(&["LeftCollar", "LeftShoulder"]),
            ["l_collar=LeftCollar", "l_shoulder=LeftShoulder"]
        );
        assert_eq!(matched(&["L_KNEE", "Prop"]), ["l_knee=L_KNEE"]);
        assert_eq!(
            matched(&["LeftShoulder", "LeftElbow"]),
            ["l_shoulder=LeftShoulder", "l_elbow=LeftElbow"]
        );
    }

    #[test]
    fn fingers_are_those_of_rigs_that_have_them() {
        type Finger = fn(usize) -> String;
        let rigs: [(&str, &str, Finger); 4] = [
            ("Mixamo", "mixamorig:LeftHand", |at| {
                let finger = ["Index", "Middle", "Pinky", "Ring", "Thumb"][at / 3];
                format!("mixamorig:LeftHand{finger}{}", at % 3 + 1)
            }),
            ("Unity", "LeftHand", |at| {
                let finger = ["Index", "Middle", "Little", "Ring", "Thumb"][at / 3];
                let part = ["Proximal", "Intermediate", "Distal"][at % 3];
                format!("Left{finger}{part}")
            }),
            ("Unreal", "hand_l", |at| {
                let finger = ["index", "middle", "pinky", "ring", "thumb"][at / 3];
                format!("{finger}_0{}_l", at % 3 + 1)
            }),
            ("3ds Max Biped", "Bip001 L Hand", |at| {
                let finger = [1, 2, 4, 3, 0][at / 3];
                let part = ["", "1", "2"][at % 3];
                format!("Bip001 L Finger{finger}{part}")
            }),
        ];
        for (rig, hand, name) in rigs {
            let fingers: Vec<String> = (0..15).map(name).collect();
            let mut names = vec![hand];
            names.extend(fingers.iter().map(String::as_str));
            let mut wanted = vec![format!("l_wrist={hand}")];
            let joints = FINGERS.iter().zip(&fingers);
            wanted.extend(joints.map(|((joint, _), name)| format!("{joint}={name}")));
            assert_eq!(matched(&names), wanted, "{rig}");
        }
        // Two fingers are no hand: one of them is where the hand's joint is.
        assert_eq!(
            matched(&["LeftHand", "LeftHandIndex1", "LThumb"]),
            ["l_wrist=LeftHand", "l_hand=LeftHandIndex1"]
        );
    }

    /// The limbs of each rig: hip, knee, ankle, shoulder, elbow and wrist of the left side, and the pelvis and head.
    const RIGS: [(&str, [&str; 8]); 12] = [
        (
            "Unity",
            [
                "LeftUpperLeg",
                "LeftLowerLeg",
                "LeftFoot",
                "LeftUpperArm",
                "LeftLowerArm",
                "LeftHand",
                "Hips",
                "Head",
            ],
        ),
        (
            "Mixamo",
            [
                "mixamorig:LeftUpLeg",
                "mixamorig:LeftLeg",
                "mixamorig:LeftFoot",
                "mixamorig:LeftArm",
                "mixamorig:LeftForeArm",
                "mixamorig:LeftHand",
                "mixamorig:Hips",
                "mixamorig:Head",
            ],
        ),
        (
            "Rigify",
            [
                "DEF-thigh.L",
                "DEF-shin.L",
                "DEF-foot.L",
                "DEF-upper_arm.L",
                "DEF-forearm.L",
                "DEF-hand.L",
                "DEF-spine",
                "DEF-spine.006",
            ],
        ),
        (
            "Unreal",
            [
                "thigh_l",
                "calf_l",
                "foot_l",
                "upperarm_l",
                "lowerarm_l",
                "hand_l",
                "pelvis",
                "head",
            ],
        ),
        (
            "VRM",
            [
                "J_Bip_L_UpperLeg",
                "J_Bip_L_LowerLeg",
                "J_Bip_L_Foot",
                "J_Bip_L_UpperArm",
                "J_Bip_L_LowerArm",
                "J_Bip_L_Hand",
                "J_Bip_C_Hips",
                "J_Bip_C_Head",
            ],
        ),
        (
            "Daz",
            [
                "lThighBend",
                "lShin",
                "lFoot",
                "lShldrBend",
                "lForearmBend",
                "lHand",
                "hip",
                "head",
            ],
        ),
        (
            "Genesis 9",
            [
                "l_thigh",
                "l_shin",
                "l_foot",
                "l_upperarm",
                "l_forearm",
                "l_hand",
                "hip",
                "head",
            ],
        ),
        (
            "3ds Max Biped",
            [
                "Bip001 L Thigh",
                "Bip001 L Calf",
                "Bip001 L Foot",
                "Bip001 L UpperArm",
                "Bip001 L Forearm",
                "Bip001 L Hand",
                "Bip001 Pelvis",
                "Bip001 Head",
            ],
        ),
        (
            "HumanIK",
            [
                "Character1_LeftUpLeg",
                "Character1_LeftLeg",
                "Character1_LeftFoot",
                "Character1_LeftArm",
                "Character1_LeftForeArm",
                "Character1_LeftHand",
                "Character1_Hips",
                "Character1_Head",
            ],
        ),
        (
            "Kinect",
            [
                "HIP_LEFT",
                "KNEE_LEFT",
                "ANKLE_LEFT",
                "SHOULDER_LEFT",
                "ELBOW_LEFT",
                "WRIST_LEFT",
                "PELVIS",
                "HEAD",
            ],
        ),
        (
            "Kinect 2",
            [
                "HipLeft",
                "KneeLeft",
                "AnkleLeft",
                "ShoulderLeft",
                "ElbowLeft",
                "WristLeft",
                "SpineBase",
                "Head",
            ],
        ),
        (
            "SMPL with a prefix",
            [
                "f_mosh_cmu_05_L_Hip",
                "f_mosh_cmu_05_L_Knee",
                "f_mosh_cmu_05_L_Ankle",
                "f_mosh_cmu_05_L_Shoulder",
                "f_mosh_cmu_05_L_Elbow",
                "f_mosh_cmu_05_L_Wrist",
                "f_mosh_cmu_05_Pelvis",
                "f_mosh_cmu_05_Head",
            ],
        ),
    ];

    #[test]
    fn every_rig_s_limbs_are_known() {
        let joints = [
            "l_hip",
            "l_knee",
            "l_ankle",
            "l_shoulder",
            "l_elbow",
            "l_wrist",
            "pelvis",
            "head",
        ];
        for (rig, names) in RIGS {
            // What else such a rig has, which must not be taken for these.
            let others: &[&str] = match rig {
                "Rigify" => &[
                    "DEF-spine.001",
                    "DEF-spine.002",
                    "DEF-spine.003",
                    "DEF-spine.004",
                    "DEF-shoulder.L",
                ],
                "Kinect" => &[
                    "CLAVICLE_LEFT",
                    "HAND_LEFT",
                    "FOOT_LEFT",
                    "SPINE_NAVEL",
                    "SPINE_CHEST",
                ],
                "Kinect 2" => &["HandLeft", "FootLeft", "SpineMid", "SpineShoulder"],
                "Unreal" => &[
                    "root",
                    "clavicle_l",
                    "ball_l",
                    "upperarm_twist_01_l",
                    "spine_01",
                ],
                "Unity" => &["LeftShoulder", "LeftToes", "Spine", "Chest", "UpperChest"],
                "Daz" => &["lThighTwist", "lShldrTwist", "lCollar", "abdomenLower"],
                "Genesis 9" => &["l_shoulder", "l_toes", "spine1"],
                _ => &[],
            };
            let all: Vec<&str> = names.iter().chain(others).copied().collect();
            let found = matched(&all);
            for (joint, name) in joints.iter().zip(names) {
                assert!(
                    found.contains(&format!("{joint}={name}")),
                    "{rig}: {joint}: {found:?}"
                );
            }
        }
        let kinect = matched(&["WristLeft", "HandLeft", "AnkleLeft", "FootLeft"]);
        assert!(kinect.contains(&"l_hand=HandLeft".to_owned()), "{kinect:?}");
        assert!(kinect.contains(&"l_foot=FootLeft".to_owned()), "{kinect:?}");
    }

    #[test]
    fn what_is_no_map_is_refused() {
        for bad in ["[]", "{", "{\"a\": 1}", "{\"a\": [1]}"] {
            assert!(JointMap::parse(bad).is_err(), "{bad}");
        }
        let one = JointMap::parse("{\"tail\": \"Tail_01\"}").expect("a name alone");
        assert_eq!(one.matches(&["tail_01".into()]), [("tail".to_owned(), 0)]);
    }
}
