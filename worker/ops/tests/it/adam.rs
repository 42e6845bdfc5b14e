use crate::{numbers, relative_error, values};
use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::adam::{self, AdamRates};

#[test]
fn adam_equals_its_reference_and_leaves_shared_tensors_alone() {
    let device = Device::flex();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let shape = [9000];
    let param = numbers(&mut rng, shape, -1.0, 1.0, &device);
    let grad = numbers(&mut rng, shape, -1.0, 1.0, &device);
    let (m, v) = (
        numbers(&mut rng, shape, -1.0, 1.0, &device),
        numbers(&mut rng, shape, 0.0, 1.0, &device),
    );
    let before = values(param.clone());
    let rates = AdamRates::new(1e-2, 0.9, 0.999, 1e-8, 3);
    let ours = adam::update(param.clone(), grad.clone(), m.clone(), v.clone(), rates);
    let reference = adam::reference::update(param.clone(), grad, m, v, rates);
    for (a, b) in [
        (ours.0, reference.0),
        (ours.1, reference.1),
        (ours.2, reference.2),
    ] {
        let error = relative_error(&values(a), &values(b));
        assert!(error < 1e-6, "{error:e}");
    }
    assert_eq!(
        values(param),
        before,
        "the update must not write through a shared tensor"
    );
}

#[test]
#[should_panic(expected = "gradient and moments of a parameter")]
fn a_gradient_of_another_size_is_refused() {
    let rates = AdamRates::new(1e-2, 0.9, 0.999, 1e-8, 1);
    adam::cpu::update(
        &mut [0.0; 3],
        &[1.0; 2],
        &mut [0.0; 3],
        &mut [0.0; 3],
        rates,
    );
}
