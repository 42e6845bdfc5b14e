//! How [`Encoding::Hash`](super::Encoding::Hash) writes the size of people's own tables:
//! `{"kind": "split", "own_log2_rows": 12}`. Other kinds, in checkpoints of experiments, are refused by name.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
enum Sharing {
    Split { own_log2_rows: u32 },
}

pub(super) fn serialize<S: Serializer>(
    own_log2_rows: &u32,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let own_log2_rows = *own_log2_rows;
    Sharing::Split { own_log2_rows }.serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    let Sharing::Split { own_log2_rows } = Sharing::deserialize(deserializer)?;
    Ok(own_log2_rows)
}
