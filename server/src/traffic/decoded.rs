//! How much memory a message takes once it is decoded, by the contract's descriptors.
//!
//! The length of a message says little about it: an empty entry of a list has two bytes on the wire, and hundreds in memory.

use prost::Message;
use prost::encoding::decode_varint;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorSet};
use std::collections::HashMap;
use std::sync::LazyLock;

/// Bytes of a `String` or `Vec` without its content.
const LIST: usize = 24;
/// Bytes of a number or a small enum, with the flag of an optional one.
const NUMBER: usize = 16;
/// Bytes that an allocation takes beside its content.
const ALLOCATION: usize = 16;
/// A list grows to twice its length.
const GROWTH: usize = 2;
/// Nested messages that prost decodes.
const DEPTH: usize = 100;

/// The contract's messages by their full names with a leading dot.
static SHAPES: LazyLock<HashMap<String, Shape>> = LazyLock::new(shapes);

struct Shape {
    fields: HashMap<u64, Field>,
    /// Bytes of an empty message.
    bytes: usize,
}

struct Field {
    repeated: bool,
    holds: Holds,
}

enum Holds {
    /// A text, or bytes.
    Text,
    /// Numbers of a fixed length, bytes.
    Fixed(usize),
    /// Numbers of variable length.
    Varint,
    Message(String),
}

/// An upper bound for the bytes of the decoded `message` of the type `name`, such as `.yoto.v1.JobSpec`, beside its own
/// fields. The count ends once it is above `most`. A message of an unknown type counts as nothing.
pub(super) fn bytes(name: &str, message: &[u8], most: usize) -> usize {
    let mut count = Count { bytes: 0, most };
    // Where a message is malformed, decoding ends as well.
    let _ = count.message(name, message, DEPTH);
    count.bytes
}

struct Count {
    bytes: usize,
    most: usize,
}

impl Count {
    /// Counts a message; `None` ends the count.
    fn message(&mut self, name: &str, mut rest: &[u8], depth: usize) -> Option<()> {
        let shape = SHAPES.get(name)?;
        while !rest.is_empty() && self.bytes <= self.most {
            let key = decode_varint(&mut rest).ok()?;
            let field = shape.fields.get(&(key >> 3));
            let length = match key & 7 {
                0 => {
                    decode_varint(&mut rest).ok()?;
                    0
                }
                1 => 8,
                5 => 4,
                2 => usize::try_from(decode_varint(&mut rest).ok()?).ok()?,
                // The fields of a group are counted as if they stood outside.
                3 | 4 => continue,
                _ => return None,
            };
            let content;
            (content, rest) = rest.split_at_checked(length)?;
            if let Some(field) = field {
                self.field(field, content, key & 7 == 2, depth)?;
            }
        }
        Some(())
    }

    fn field(
        &mut self,
        field: &Field,
        content: &[u8],
        delimited: bool,
        depth: usize,
    ) -> Option<()> {
        let entry = match (field.repeated, &field.holds) {
            (false, _) => 0,
            (true, Holds::Text) => LIST,
            (true, Holds::Message(name)) => SHAPES.get(name).map_or(0, |it| it.bytes),
            (true, Holds::Fixed(bytes)) if delimited => content.len() / bytes * bytes,
            (true, Holds::Varint) if delimited => {
                8 * content.iter().filter(|byte| **byte < 0x80).count()
            }
            (true, Holds::Fixed(_) | Holds::Varint) => 8,
        };
        self.bytes += GROWTH * entry;
        match &field.holds {
            Holds::Text if delimited => self.bytes += ALLOCATION + content.len(),
            Holds::Message(name) if delimited && depth > 0 => {
                self.message(name, content, depth - 1)?;
            }
            _ => {}
        }
        Some(())
    }
}

fn shapes() -> HashMap<String, Shape> {
    let set = FileDescriptorSet::decode(yoto_proto::DESCRIPTORS).unwrap_or_default();
    let mut messages = HashMap::new();
    for file in &set.file {
        let outer = format!(".{}", file.package());
        file.message_type
            .iter()
            .for_each(|it| add(&mut messages, &outer, it));
    }
    let shape = |(name, message): (&String, &&DescriptorProto)| {
        let fields = message.field.iter();
        let fields = fields.map(|it| (it.number() as u64, Field::of(it)));
        let shape = Shape {
            fields: fields.collect(),
            bytes: size(&messages, message, &mut vec![name.clone()]),
        };
        (name.clone(), shape)
    };
    messages.iter().map(shape).collect()
}

/// Adds a message and those inside by their full names.
fn add<'a>(
    messages: &mut HashMap<String, &'a DescriptorProto>,
    outer: &str,
    message: &'a DescriptorProto,
) {
    let name = format!("{outer}.{}", message.name());
    for inner in &message.nested_type {
        add(messages, &name, inner);
    }
    messages.insert(name, message);
}

/// Bytes of an empty message, with the messages that it holds in place. `around` are the messages that contain it: one of
/// them is boxed.
fn size(
    messages: &HashMap<String, &DescriptorProto>,
    message: &DescriptorProto,
    around: &mut Vec<String>,
) -> usize {
    let mut bytes = 0;
    for field in &message.field {
        let name = field.type_name();
        let Field { repeated, holds } = Field::of(field);
        bytes += match (repeated, holds, messages.get(name)) {
            (true, ..) | (false, Holds::Text, _) => LIST,
            (false, Holds::Message(name), Some(inner)) if !around.contains(&name) => {
                around.push(name);
                let inner = size(messages, inner, around);
                around.pop();
                inner + NUMBER
            }
            _ => NUMBER,
        };
    }
    bytes
}

impl Field {
    fn of(field: &FieldDescriptorProto) -> Self {
        let holds = match field.r#type() {
            Type::String | Type::Bytes => Holds::Text,
            Type::Message | Type::Group => Holds::Message(field.type_name().to_owned()),
            Type::Double | Type::Fixed64 | Type::Sfixed64 => Holds::Fixed(8),
            Type::Float | Type::Fixed32 | Type::Sfixed32 => Holds::Fixed(4),
            _ => Holds::Varint,
        };
        Self {
            repeated: field.label() == Label::Repeated,
            holds,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::limits::MESSAGE_BYTES;
    use yoto_proto::v1::{
        Actor, CreateUploadRequest, FileHeader, ListJobsRequest, MotionClip, RenderSpec, Scene,
        render_spec,
    };

    const MOST: usize = usize::MAX;

    #[test]
    fn empty_entries_count_with_what_they_take() {
        let upload = |files: usize| {
            let request = CreateUploadRequest {
                files: vec![FileHeader::default(); files],
                ..<_>::default()
            };
            bytes(
                ".yoto.v1.CreateUploadRequest",
                &request.encode_to_vec(),
                MOST,
            )
        };
        assert!(upload(1000) >= 1000 * size_of::<FileHeader>());
        let scene = Scene {
            actors: vec![Actor::default(); 1000],
            ..<_>::default()
        };
        let render = RenderSpec {
            what: Some(render_spec::What::Scene(scene)),
            ..<_>::default()
        };
        let counted = bytes(".yoto.v1.RenderSpec", &render.encode_to_vec(), MOST);
        assert!(counted >= 1000 * size_of::<Actor>(), "{counted}");
        let list = ListJobsRequest {
            states: vec![1; 1000],
            ..<_>::default()
        };
        let counted = bytes(".yoto.v1.ListJobsRequest", &list.encode_to_vec(), MOST);
        assert!(counted >= 1000 * size_of::<i32>(), "{counted}");
    }

    #[test]
    fn a_large_message_of_real_content_counts_little_more_than_its_length() {
        let file = FileHeader {
            path: "frames/000000.png".into(),
            bytes: 1 << 20,
            sha256: "0".repeat(64),
        };
        let upload = CreateUploadRequest {
            files: vec![file; 60_000],
            ..<_>::default()
        };
        let message = upload.encode_to_vec();
        let counted = bytes(".yoto.v1.CreateUploadRequest", &message, MOST);
        assert!(counted < 3 * MESSAGE_BYTES, "{counted}");
        let pose = yoto_proto::v1::BodyPose {
            rotations: vec![0.5; 72],
            ..<_>::default()
        };
        let clip = MotionClip {
            poses: vec![pose; 10_000],
            ..<_>::default()
        };
        let message = clip.encode_to_vec();
        let counted = bytes(".yoto.v1.MotionClip", &message, MOST);
        assert!(
            counted < 3 * message.len(),
            "{counted} of {}",
            message.len()
        );
    }

    #[test]
    fn no_byte_hides_what_follows_and_the_count_ends() {
        let group = [0x1b, 0x1c];
        let entries = vec![0x12, 0]; // `files`, empty
        let message = [&group[..], &entries.repeat(1000)].concat();
        let name = ".yoto.v1.CreateUploadRequest";
        let one = bytes(name, &entries, MOST);
        assert_eq!(bytes(name, &message, MOST), 1000 * one);
        let counted = bytes(name, &message, 10 * one);
        assert_eq!(counted, 11 * one);
        assert_eq!(bytes(".nothing", &message, MOST), 0);
        for cut in 0..4 {
            bytes(name, &[0x12, 9, 0xff, 0xff][..cut], MOST);
        }
    }
}
