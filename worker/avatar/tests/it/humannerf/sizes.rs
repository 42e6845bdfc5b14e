//! Numbers of parameters of the parts of a model.

use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor};
use yoto_avatar::avatar::Avatar;
use yoto_avatar::config::ModelConfig;

/// The parts of a model, in the order in which data passes through them.
const PARTS: [&str; 6] = [
    "motion",
    "correction",
    "codes",
    "condition",
    "non_rigid",
    "canonical",
];

/// Counts the parameters of each part, which is the first name of their paths.
#[derive(Default)]
struct PartCounts {
    path: Vec<String>,
    numbers: [u64; PARTS.len()],
}

impl ModuleVisitor for PartCounts {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let part = PARTS.iter().position(|part| *part == self.path[0]);
        let part = part.expect("a part of the paper's model");
        self.numbers[part] += param.val().shape().num_elements() as u64;
    }
}

#[test]
fn parts_have_the_published_sizes() {
    let device = Device::flex();
    let count = |variant: &str, people: usize| -> Vec<(&str, u64)> {
        let config = ModelConfig::named("paper", variant).expect("named");
        let avatar = Avatar::new(&config, people, 24, 0, &device);
        let mut counts = PartCounts::default();
        avatar.visit(&mut counts);
        let total = avatar.num_params() as u64;
        assert_eq!(
            counts.numbers.iter().sum::<u64>(),
            total,
            "no part is left out"
        );
        let parts = PARTS.into_iter().zip(counts.numbers);
        parts.filter(|(_, parameters)| *parameters > 0).collect()
    };
    let humannerf = count("humannerf", 1);
    assert_eq!(
        humannerf,
        [
            ("motion", 63_589_145),
            ("correction", 233_029),
            ("non_rigid", 101_123),
            ("canonical", 494_084),
        ]
    );
    let total = |parts: &[(&str, u64)]| parts.iter().map(|(_, count)| count).sum::<u64>();
    assert_eq!(total(&humannerf), 64_417_381);
    // Six people, as in the paper, which states 65.3 million.
    let yoto = count("yoto", 6);
    println!("yoto, six people: {} in all, {yoto:?}", total(&yoto));
    assert_eq!(total(&yoto), 64_724_325);
}
