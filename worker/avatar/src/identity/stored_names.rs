//! Names of parameters in checkpoints.
//!
//! Burn names a tensor after the fields that lead to it, and [`init::id`](crate::init::id) makes an optimiser's number of that
//! name. A field that was renamed in the program keeps its name in both: this table is the only place that knows it.

use burn::store::KeyRemapper;

/// A part of the model, the name of a field in it, and the field's name in checkpoints.
const RENAMED: [(&str, &str, &str); 3] = [
    ("splats", "rotations", "turns"),
    ("splats", "frozen", "held"),
    ("pose_shapes", "pose_ranges", "filmed"),
];

/// The name in checkpoints of the parameter at `path`, as in `splats.2.turns` for `splats.2.rotations`.
pub(crate) fn stored(path: &str) -> String {
    renamed(path, |(part, field, stored)| (part, field, stored))
}

/// The path in the program of the parameter that checkpoints call `name`: the inverse of [`stored`].
pub(crate) fn field(name: &str) -> String {
    renamed(name, |(part, field, stored)| (part, stored, field))
}

/// A row of [`RENAMED`], or with its last two names exchanged.
type Row = (&'static str, &'static str, &'static str);

/// `path` with the names that `order` tells to replace in a part by others.
fn renamed(path: &str, order: impl Fn(Row) -> Row) -> String {
    let (part, rest) = path.split_once('.').unwrap_or((path, ""));
    let name = |name| {
        let mut rows = RENAMED.into_iter().map(&order);
        let row = rows.find(|(of, from, _)| (*of, *from) == (part, name));
        row.map_or(name, |(.., to)| to)
    };
    let names: Vec<&str> = rest.split('.').map(name).collect();
    match rest {
        "" => part.to_owned(),
        _ => format!("{part}.{}", names.join(".")),
    }
}

/// Renames parameters of the program to those of checkpoints.
pub(crate) fn to_checkpoint() -> KeyRemapper {
    remapper(|(part, field, stored)| (part, field, stored))
}

/// Renames parameters of checkpoints to those of the program.
pub(crate) fn from_checkpoint() -> KeyRemapper {
    remapper(|(part, field, stored)| (part, stored, field))
}

/// Renames as [`renamed`] does.
fn remapper(order: impl Fn(Row) -> Row) -> KeyRemapper {
    let pattern = |row| {
        let (part, from, to) = order(row);
        (
            format!(r"^({part}(?:\.\d+)?)\.{from}(\.|$)"),
            format!("${{1}}.{to}${{2}}"),
        )
    };
    KeyRemapper::from_patterns(RENAMED.into_iter().map(pattern).collect())
        .expect("names are valid patterns")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::avatar::Avatar;
    use crate::config::ModelConfig;
    use crate::host::read;
    use crate::init::id;
    use crate::train::{ModelState, save_model};
    use burn::tensor::Device;
    use safetensors::SafeTensors;
    use yoto_proto::manifest::files;

    #[test]
    fn renamed_fields_keep_their_names_and_numbers() {
        assert_eq!(stored("splats.2.rotations"), "splats.2.turns");
        assert_eq!(stored("pose_shapes.pose_ranges.0"), "pose_shapes.filmed.0");
        for path in [
            "splats.2.means",
            "motion.base",
            "codes.1",
            "canonical.rotations",
        ] {
            assert_eq!(stored(path), path);
        }
        let config = ModelConfig::named("splat", "yoto").expect("a tier");
        let avatar = Avatar::new(&config, 1, 4, 3, &Device::flex());
        assert_eq!(avatar.splats[0].rotations.id, id("splats.0.turns"));
    }

    /// A checkpoint has the names that earlier versions wrote, and is read by them.
    #[test]
    fn checkpoints_have_the_stored_names() {
        let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
        config.appearance.splats_mut().expect("splats").count = 64;
        let device = Device::flex();
        let mut avatar = Avatar::new(&config, 1, 4, 3, &device);
        let flags: Vec<bool> = (0..64).map(|index| index % 3 == 0).collect();
        avatar.freeze_colours(0, Some(&flags)).expect("freezes");
        let state = ModelState::new(config, 4, 3, vec![None]);
        let dir = tempfile::tempdir().expect("a folder");
        save_model(dir.path(), &state, &avatar).expect("saves");
        let bytes = std::fs::read(dir.path().join(files::WEIGHTS)).expect("weights");
        let weights = SafeTensors::deserialize(&bytes).expect("tensors");
        let mut names: Vec<&str> = weights.names().into_iter().collect();
        names.retain(|name| name.starts_with("splats.") || name.starts_with("pose_shapes.f"));
        names.sort_unstable();
        let expected = [
            "colours",
            "held",
            "light",
            "means",
            "opacities",
            "scales",
            "turns",
        ];
        let expected = expected.map(|name| format!("splats.0.{name}"));
        assert_eq!(names[0], "pose_shapes.filmed.0");
        assert_eq!(names[1..], expected);
        let loaded = crate::train::load_avatar(dir.path(), &state, 1, &device).expect("loads");
        assert_eq!(loaded.frozen_colours(0).expect("reads"), Some(flags));
        let rotations = |avatar: &Avatar| read(avatar.splats[0].rotations.val()).expect("reads");
        assert_eq!(rotations(&loaded), rotations(&avatar));
        let json = std::fs::read(dir.path().join(files::STATE)).expect("a state");
        let json: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
        for path in [
            "/progress",
            "/goes_on",
            "/practice",
            "/config/splats/turn_rate",
            "/config/refinement/turn",
            "/config/refinement/turn_jitter",
            "/config/sampling/turns",
        ] {
            assert!(json.pointer(path).is_some(), "{path}");
        }
    }
}
