//! Programs of an earlier version understand this contract: every message, field, enum value and call of
//! `baseline/v1.binpb` is still there, with the same number, type and meaning on the wire.
//!
//! The baseline is written anew, by `cargo run -p yoto-proto --example baseline`, only with a change that
//! adds to it.

use prost::Message;
use prost_types::{
    DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto,
    FileDescriptorSet, MethodDescriptorProto, ServiceDescriptorProto,
};
use std::collections::BTreeMap;

/// What users call, and what workers call.
const PACKAGES: [&str; 2] = ["yoto.v1", "yoto.worker.v1"];

/// Everything of a contract by its full name.
#[derive(Default)]
struct Contract {
    messages: BTreeMap<String, DescriptorProto>,
    enums: BTreeMap<String, EnumDescriptorProto>,
    services: BTreeMap<String, ServiceDescriptorProto>,
}

impl Contract {
    fn read(bytes: &[u8]) -> Self {
        let set = FileDescriptorSet::decode(bytes).expect("descriptors");
        let mut contract = Self::default();
        let ours = |it: &FileDescriptorProto| PACKAGES.contains(&it.package());
        for file in set.file.into_iter().filter(ours) {
            let package = file.package().to_owned();
            let full = |name: &str| format!("{package}.{name}");
            for message in file.message_type {
                contract.add(full(""), message);
            }
            let enums = file.enum_type.into_iter();
            contract.enums.extend(enums.map(|it| (full(it.name()), it)));
            let services = file.service.into_iter();
            contract
                .services
                .extend(services.map(|it| (full(it.name()), it)));
        }
        contract
    }

    fn add(&mut self, outer: String, message: DescriptorProto) {
        let name = format!("{outer}{}", message.name());
        for inner in &message.nested_type {
            self.add(format!("{name}."), inner.clone());
        }
        for inner in &message.enum_type {
            self.enums
                .insert(format!("{name}.{}", inner.name()), inner.clone());
        }
        self.messages.insert(name, message);
    }
}

/// What of a field is on the wire, or in JSON.
fn wire(field: &FieldDescriptorProto) -> (&str, i32, i32, &str) {
    let kind = (field.r#type() as i32, field.label() as i32);
    (field.name(), kind.0, kind.1, field.type_name())
}

/// What a program of `old` would miss in `new`.
fn broken(old: &Contract, new: &Contract) -> Vec<String> {
    let mut broken = Vec::new();
    for (name, old) in &old.messages {
        let Some(new) = new.messages.get(name) else {
            broken.push(format!("message {name} is gone"));
            continue;
        };
        for old in &old.field {
            let number = old.number();
            let new = new.field.iter().find(|it| it.number() == number);
            if new.map(wire) != Some(wire(old)) {
                let change = new.map(wire);
                let old = old.name();
                broken.push(format!("{name}.{old} = {number} is now {change:?}"));
            }
        }
    }
    for (name, old) in &old.enums {
        let values = new.enums.get(name).map(|it| &it.value);
        for old in &old.value {
            let same = |it: &&_| value(it) == value(old);
            if values.is_none_or(|values| values.iter().find(same).is_none()) {
                broken.push(format!("{name}.{} is gone", old.name()));
            }
        }
    }
    for (name, old) in &old.services {
        let methods = new.services.get(name).map(|it| &it.method);
        for old in &old.method {
            let same = |it: &MethodDescriptorProto| call(it) == call(old);
            if methods.is_none_or(|methods| !methods.iter().any(same)) {
                broken.push(format!("{name}/{} is gone, or another call", old.name()));
            }
        }
    }
    broken
}

/// What of a call is on the wire.
fn call(method: &MethodDescriptorProto) -> (&str, &str, &str, bool, bool) {
    let streams = (method.client_streaming(), method.server_streaming());
    let (input, output) = (method.input_type(), method.output_type());
    (method.name(), input, output, streams.0, streams.1)
}

fn value(value: &prost_types::EnumValueDescriptorProto) -> (&str, i32) {
    (value.name(), value.number())
}

#[test]
fn programs_of_earlier_versions_understand_it() {
    let old = Contract::read(include_bytes!("../baseline/v1.binpb"));
    let new = Contract::read(yoto_proto::DESCRIPTORS);
    let broken = broken(&old, &new);
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn a_change_of_the_contract_is_found() {
    let old = Contract::read(yoto_proto::DESCRIPTORS);
    let mut new = Contract::read(yoto_proto::DESCRIPTORS);
    let claim = new
        .messages
        .get_mut("yoto.worker.v1.Claim")
        .expect("is there");
    claim.field[2].number = Some(9);
    let states = new.enums.get_mut("yoto.v1.Job.State").expect("is there");
    states.value.pop();
    let jobs = new
        .services
        .get_mut("yoto.v1.JobService")
        .expect("is there");
    jobs.method[0].output_type = Some(".yoto.v1.Model".into());
    new.messages.remove("yoto.v1.Scene");
    assert_eq!(broken(&old, &new).len(), 4);
}
