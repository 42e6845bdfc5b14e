//! The map from a motion's joints to a person's joints, by name.
//!
//! A map is JSON: `{"l_knee": ["LeftLeg", "LeftKnee"], …}`, each joint of the person with the names
//! that motions have for it. The first name that the motion has, and that no earlier joint took,
//! is used. A joint's own name always matches: before all others if the motion has it in the same
//! case, after them otherwise, since `Spine1` is `spine1` for few writers. Otherwise case does not
//! matter, nor a prefix before a colon (`mixamorig:Hips`).

use std::collections::HashSet;
use std::path::Path;
use yoto_client::ClientError;

/// The default map: names of CMU's conversions, Mixamo,
/// MotionBuilder, Poser, Unreal, Bandai-Namco and SMPL itself. `yoto motion --write-map` writes it for
/// editing.
pub const DEFAULT: &str = include_str!("joint_map.json");

/// Joints of a person, each with the names that motions have for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointMap(Vec<(String, Vec<String>)>);

impl JointMap {
    /// The map of a file, or the default.
    ///
    /// # Errors
    /// When the file can't be read or is not a map.
    pub fn open(path: Option<&Path>) -> Result<Self, ClientError> {
        let Some(path) = path else {
            return Self::parse(DEFAULT).map_err(ClientError::Name);
        };
        let text = std::fs::read_to_string(path).map_err(ClientError::file("reading", path))?;
        Self::parse(&text)
            .map_err(|message| ClientError::Name(format!("{}: {message}", path.display())))
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
        let plain = |name: &str| {
            let short = name.rsplit_once(':').map_or(name, |(_, short)| short);
            short.trim().to_ascii_lowercase()
        };
        let known: Vec<String> = names.iter().map(|name| plain(name)).collect();
        let mut taken = HashSet::new();
        let mut found = Vec::new();
        for (joint, wanted) in &self.0 {
            let own = names.iter().position(|name| name == joint);
            let index = own.filter(|at| !taken.contains(at)).or_else(|| {
                wanted.iter().chain([joint]).find_map(|wanted| {
                    let wanted = plain(wanted);
                    let mut indices = (0..known.len()).filter(|at| known.get(*at) == Some(&wanted));
                    indices.find(|at| !taken.contains(at))
                })
            });
            if let Some(index) = index {
                taken.insert(index);
                found.push((joint.clone(), index));
            }
        }
        found
    }
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
