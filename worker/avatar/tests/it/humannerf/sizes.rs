//! Numbers of parameters of the parts of a model.

use burn::tensor::Device;
use yoto_avatar::avatar::{Avatar, PartCount};
use yoto_avatar::config::ModelConfig;

#[test]
fn parts_have_the_published_sizes() {
    let device = Device::flex();
    let count = |variant: &str, people: usize| -> Vec<PartCount> {
        let config = ModelConfig::named("paper", variant).expect("named");
        Avatar::new(&config, people, 24, 0, &device).part_counts()
    };
    let numbers = |parts: &[PartCount]| -> Vec<(String, u64)> {
        parts
            .iter()
            .map(|p| (p.part.clone(), p.parameters))
            .collect()
    };
    let humannerf = count("humannerf", 1);
    assert_eq!(
        numbers(&humannerf),
        [
            ("motion".to_owned(), 63_589_145),
            ("correction".to_owned(), 233_029),
            ("non_rigid".to_owned(), 101_123),
            ("canonical".to_owned(), 494_084),
        ]
    );
    let total = |parts: &[PartCount]| parts.iter().map(|p| p.parameters).sum::<u64>();
    assert_eq!(total(&humannerf), 64_417_381);
    assert!(
        humannerf
            .iter()
            .all(|part| part.bytes == 4 * part.parameters)
    );
    // Six people, as in the paper, which states 65.3 million.
    let yoto = count("yoto", 6);
    println!(
        "yoto, six people: {} in all, {:?}",
        total(&yoto),
        numbers(&yoto)
    );
    assert_eq!(total(&yoto), 64_724_325);
}
