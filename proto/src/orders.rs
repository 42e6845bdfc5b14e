//! Which orders a worker understands.
//!
//! A worker of an earlier version drops the fields that it does not know, and would carry out another order than the one that
//! was given. So each field and each value of an enum that an order can have has a level in `baseline/orders.txt`, an order
//! has the highest level of what it uses, and the queue gives it only to workers that know this level. A new field or value
//! gets the next level; so does one whose meaning changes.

use crate::DESCRIPTORS;
use crate::v1::JobSpec;
use prost::Message;
use prost::encoding::decode_varint;
use prost_types::field_descriptor_proto::Type;
use prost_types::{DescriptorProto, EnumDescriptorProto, FileDescriptorSet};
use std::collections::HashMap;
use std::sync::LazyLock;

/// The highest level of this version: of its workers, and of the orders that it can give.
pub const LEVEL: u32 = 4;

/// The levels of fields and values by their full names.
const TABLE: &str = include_str!("../baseline/orders.txt");
/// The message of all orders.
const ROOT: &str = ".yoto.v1.JobSpec";

/// The messages that an order can contain, by full names with a leading dot.
static CONTRACT: LazyLock<Contract> = LazyLock::new(|| Contract::read(TABLE));

/// The level of an order: the highest level of a field or value that it uses.
pub fn level(spec: &JobSpec) -> u32 {
    CONTRACT.level(ROOT, &spec.encode_to_vec()).unwrap_or(LEVEL)
}

/// What a field holds.
enum Holds {
    Other,
    Message(String),
    /// Levels of values by their numbers.
    Enum(HashMap<u64, u32>),
}

struct Field {
    level: u32,
    holds: Holds,
}

/// Fields of messages by number.
struct Contract(HashMap<String, HashMap<u64, Field>>);

impl Contract {
    fn read(table: &str) -> Self {
        let set = FileDescriptorSet::decode(DESCRIPTORS).unwrap_or_default();
        let (messages, enums) = by_name(&set);
        let levels = levels(table);
        // What the table lacks is as new as this version; a test keeps it complete.
        let level = |name: &str| levels.get(name).copied().unwrap_or(LEVEL);
        let fields = |name: &String, message: &&DescriptorProto| {
            let fields = message.field.iter().map(|field| {
                let holds = match field.r#type() {
                    Type::Message => Holds::Message(field.type_name().to_owned()),
                    Type::Enum => {
                        let values = enums.get(field.type_name());
                        let values = values.iter().flat_map(|it| &it.value);
                        let level_of =
                            |value: &str| level(&format!("{}.{value}", field.type_name()));
                        let values = values.map(|it| (it.number() as u64, level_of(it.name())));
                        Holds::Enum(values.collect())
                    }
                    _ => Holds::Other,
                };
                let level = level(&format!("{name}.{}", field.name()));
                (field.number() as u64, Field { level, holds })
            });
            fields.collect()
        };
        let all = messages
            .iter()
            .map(|(name, it)| (name.clone(), fields(name, it)));
        Self(all.collect())
    }

    /// The highest level in the encoded message called `name`; `None` if the bytes are none of it.
    fn level(&self, name: &str, mut bytes: &[u8]) -> Option<u32> {
        let fields = self.0.get(name)?;
        let mut highest = 0;
        while !bytes.is_empty() {
            let key = decode_varint(&mut bytes).ok()?;
            let field = fields.get(&(key >> 3))?;
            let of_value = match (key & 7, &field.holds) {
                (0, Holds::Enum(levels)) => *levels.get(&decode_varint(&mut bytes).ok()?)?,
                (0, _) => {
                    decode_varint(&mut bytes).ok()?;
                    0
                }
                (1, _) => split(&mut bytes, 8).map(|_| 0)?,
                (5, _) => split(&mut bytes, 4).map(|_| 0)?,
                (2, holds) => {
                    let length = decode_varint(&mut bytes).ok()?;
                    let mut inner = split(&mut bytes, usize::try_from(length).ok()?)?;
                    match holds {
                        Holds::Message(name) => self.level(name, inner)?,
                        Holds::Enum(levels) => {
                            let mut highest = 0;
                            while !inner.is_empty() {
                                let value = decode_varint(&mut inner).ok()?;
                                highest = highest.max(*levels.get(&value)?);
                            }
                            highest
                        }
                        Holds::Other => 0,
                    }
                }
                _ => return None,
            };
            highest = highest.max(field.level).max(of_value);
        }
        Some(highest)
    }
}

fn split<'a>(bytes: &mut &'a [u8], at: usize) -> Option<&'a [u8]> {
    let (head, tail) = bytes.split_at_checked(at)?;
    *bytes = tail;
    Some(head)
}

type ByName<'a, T> = HashMap<String, &'a T>;

/// All messages and enums by their full names.
fn by_name(
    set: &FileDescriptorSet,
) -> (ByName<'_, DescriptorProto>, ByName<'_, EnumDescriptorProto>) {
    let (mut messages, mut enums) = (HashMap::new(), HashMap::new());
    for file in &set.file {
        let package = format!(".{}", file.package());
        enums.extend(named_enums(&package, &file.enum_type));
        for message in &file.message_type {
            add(&package, message, &mut messages, &mut enums);
        }
    }
    (messages, enums)
}

fn named_enums<'a>(
    outer: &str,
    enums: &'a [EnumDescriptorProto],
) -> impl Iterator<Item = (String, &'a EnumDescriptorProto)> {
    enums
        .iter()
        .map(move |it| (format!("{outer}.{}", it.name()), it))
}

/// Adds a message with those inside of it.
fn add<'a>(
    outer: &str,
    message: &'a DescriptorProto,
    messages: &mut ByName<'a, DescriptorProto>,
    enums: &mut ByName<'a, EnumDescriptorProto>,
) {
    let name = format!("{outer}.{}", message.name());
    enums.extend(named_enums(&name, &message.enum_type));
    for inner in &message.nested_type {
        add(&name, inner, messages, enums);
    }
    messages.insert(name, message);
}

/// The lines `NAME LEVEL` of the table.
fn levels(table: &str) -> HashMap<String, u32> {
    let lines = table.lines().filter_map(|line| line.split_once(' '));
    let lines = lines.filter_map(|(name, level)| Some((name.to_owned(), level.parse().ok()?)));
    lines.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::job_spec::Kind;
    use crate::v1::render_spec::What;
    use crate::v1::{Layer, Orbit, RenderSpec, TrainSpec};
    use std::collections::BTreeSet;

    /// All fields and values that an order can have.
    fn reachable() -> BTreeSet<String> {
        let set = FileDescriptorSet::decode(DESCRIPTORS).expect("descriptors");
        let (messages, enums) = by_name(&set);
        let (mut names, mut seen, mut todo) =
            (BTreeSet::new(), BTreeSet::new(), vec![ROOT.to_owned()]);
        while let Some(name) = todo.pop() {
            if !seen.insert(name.clone()) {
                continue;
            }
            for field in &messages[&name].field {
                names.insert(format!("{name}.{}", field.name()));
                match field.r#type() {
                    Type::Message => todo.push(field.type_name().to_owned()),
                    Type::Enum => names.extend(
                        (enums[field.type_name()].value.iter())
                            .map(|it| format!("{}.{}", field.type_name(), it.name())),
                    ),
                    _ => {}
                }
            }
        }
        names
    }

    #[test]
    fn every_field_and_value_of_an_order_has_a_level() {
        let levels = levels(TABLE);
        let names = reachable();
        let missing: Vec<_> = names
            .iter()
            .filter(|it| !levels.contains_key(*it))
            .collect();
        let next = LEVEL + 1;
        assert!(
            missing.is_empty(),
            "add a line with the level {next} to baseline/orders.txt for each, and set LEVEL to {next}: {missing:#?}"
        );
        let gone: Vec<_> = levels.keys().filter(|it| !names.contains(*it)).collect();
        assert!(gone.is_empty(), "no order has them: {gone:?}");
        assert_eq!(levels.values().max(), Some(&LEVEL));
    }

    #[test]
    fn an_order_has_the_level_of_its_newest_field_or_value() {
        let newer = |name: &str| {
            let line = format!("{name} 1");
            assert!(TABLE.contains(&line), "{name}");
            Contract::read(&TABLE.replace(&line, &format!("{name} 7")))
        };
        let spec = |kind| JobSpec { kind: Some(kind) }.encode_to_vec();
        let render = |layer: Layer, views| RenderSpec {
            layer: layer.into(),
            background: vec![0.5; 3],
            what: Some(What::Orbit(Orbit {
                views,
                ..Orbit::default()
            })),
            ..RenderSpec::default()
        };
        let depth = spec(Kind::Render(render(Layer::Depth, 3)));
        let plain = spec(Kind::Render(render(Layer::Unspecified, 0)));
        let train = spec(Kind::Train(TrainSpec {
            seconds: 1.5,
            harmonics: Some(0),
            ..TrainSpec::default()
        }));
        let cases: [(&str, [u32; 3]); 5] = [
            (".yoto.v1.JobSpec.render", [7, 7, 1]),
            (".yoto.v1.RenderSpec.layer", [7, 1, 1]),
            (".yoto.v1.Layer.LAYER_DEPTH", [7, 1, 1]),
            (".yoto.v1.Orbit.views", [7, 1, 1]),
            (".yoto.v1.TrainSpec.harmonics", [1, 1, 7]),
        ];
        for (name, expected) in cases {
            let contract = newer(name);
            let levels = [&depth, &plain, &train].map(|it| contract.level(ROOT, it));
            assert_eq!(levels, expected.map(Some), "{name}");
        }
        assert_eq!(CONTRACT.level(ROOT, &[0xff]), None);
        assert_eq!(level(&JobSpec::default()), 0);
    }
}
