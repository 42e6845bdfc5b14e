//! Numbers in few bytes.

/// Metres per step of a vertex of the mean.
const STEP: f32 = 1e-4;

/// Components with their scales, packed one after the other.
pub(crate) struct Packed {
    /// Largest magnitude of each component.
    pub(crate) scales: Vec<f32>,
    /// The numbers.
    pub(crate) bytes: Vec<u8>,
}

/// Packs components of `size` numbers into i16: value = scale q / 32767.
pub(crate) fn pack_fine(numbers: &[f32], size: usize) -> Packed {
    pack(numbers, size, |share| {
        ((share * f32::from(i16::MAX)).round() as i16).to_le_bytes()
    })
}

/// Packs components of `size` numbers into i8: value = scale q |q| / 127². Most numbers of a component are small, and
/// with the square their steps are finer than with a line, so that the surface stays smooth.
pub(crate) fn pack_coarse(numbers: &[f32], size: usize) -> Packed {
    pack(numbers, size, |share| {
        let root = share.abs().sqrt().copysign(share);
        ((root * f32::from(i8::MAX)).round() as i8).to_le_bytes()
    })
}

fn pack<const N: usize>(numbers: &[f32], size: usize, pack: impl Fn(f32) -> [u8; N]) -> Packed {
    let mut packed = Packed {
        scales: Vec::new(),
        bytes: Vec::with_capacity(N * numbers.len()),
    };
    for component in numbers.chunks_exact(size.max(1)) {
        let scale = component
            .iter()
            .fold(0f32, |most, number| most.max(number.abs()));
        let share = |number: &f32| if scale > 0.0 { number / scale } else { 0.0 };
        packed.scales.push(scale);
        packed
            .bytes
            .extend(component.iter().flat_map(|number| pack(share(number))));
    }
    packed
}

/// What [`pack_fine`] packed.
pub(crate) fn unpack_fine(bytes: &[u8], scales: &[f32], size: usize) -> Vec<f32> {
    let components = bytes.as_chunks::<2>().0.chunks_exact(size.max(1));
    let component = |(component, scale): (&[[u8; 2]], &f32)| -> Vec<f32> {
        let step = scale / f32::from(i16::MAX);
        let numbers = component
            .iter()
            .map(|q| step * f32::from(i16::from_le_bytes(*q)));
        numbers.collect()
    };
    components.zip(scales).flat_map(component).collect()
}

/// What [`pack_coarse`] packed.
pub(crate) fn unpack_coarse(bytes: &[u8], scales: &[f32], size: usize) -> Vec<f32> {
    let component = |(component, scale): (&[u8], &f32)| -> Vec<f32> {
        let step = scale / f32::from(i8::MAX).powi(2);
        let value = |q: &u8| {
            let q = f32::from(*q as i8);
            step * q * q.abs()
        };
        component.iter().map(value).collect()
    };
    bytes
        .chunks_exact(size.max(1))
        .zip(scales)
        .flat_map(component)
        .collect()
}

/// Metres in tenths of a millimetre, i16. `None` beyond 3.2 m.
pub(crate) fn pack_metres(numbers: &[f32]) -> Option<Vec<u8>> {
    let steps = numbers.iter().map(|metres| (metres / STEP).round());
    let fits = |step: f32| (step.abs() <= f32::from(i16::MAX)).then_some(step as i16);
    let steps: Vec<i16> = steps.map(fits).collect::<Option<_>>()?;
    Some(steps.iter().flat_map(|step| step.to_le_bytes()).collect())
}

/// What [`pack_metres`] packed.
pub(crate) fn unpack_metres(bytes: &[u8]) -> Vec<f32> {
    let steps = bytes.as_chunks::<2>().0.iter();
    steps
        .map(|step| STEP * f32::from(i16::from_le_bytes(*step)))
        .collect()
}

/// Numbers from 0 to 1 in steps of 1/255; others become 0 or 1.
pub(crate) fn pack_unit(numbers: &[f32]) -> Vec<u8> {
    let steps = numbers.iter().map(|number| (number * 255.0).round() as u8);
    steps.collect()
}

/// What [`pack_unit`] packed.
pub(crate) fn unpack_unit(bytes: &[u8]) -> Vec<f32> {
    bytes.iter().map(|step| f32::from(*step) / 255.0).collect()
}

/// Shares in steps of 1/255 that still sum to 1: what rounding down leaves goes to those that lose most.
pub(crate) fn pack_shares(shares: [f32; 4]) -> [u8; 4] {
    let exact = shares.map(|share| share.clamp(0.0, 1.0) * 255.0);
    let mut steps = exact.map(|share| share as u8);
    let left = 255 - steps.iter().map(|step| i32::from(*step)).sum::<i32>();
    let mut order = [0, 1, 2, 3];
    let lost = |at: usize| exact[at] - exact[at].floor();
    order.sort_by(|a, b| lost(*b).total_cmp(&lost(*a)));
    for at in order.into_iter().take(left.max(0) as usize) {
        steps[at] = steps[at].saturating_add(1);
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_come_back_within_a_step() {
        let numbers: Vec<f32> = (0..200).map(|i| ((i * i) as f32).sin() * 0.03).collect();
        let fine = pack_fine(&numbers, 100);
        let coarse = pack_coarse(&numbers, 100);
        let near = |back: Vec<f32>, step: f32| {
            assert_eq!(back.len(), numbers.len());
            back.iter()
                .zip(&numbers)
                .for_each(|(a, b)| assert!((a - b).abs() < step, "{a} {b}"));
        };
        near(unpack_fine(&fine.bytes, &fine.scales, 100), 1e-6);
        // The largest step is at the largest number.
        near(
            unpack_coarse(&coarse.bytes, &coarse.scales, 100),
            0.03 / 120.0,
        );
        let nothing = pack_coarse(&[0.0; 3], 3);
        assert_eq!(unpack_coarse(&nothing.bytes, &nothing.scales, 3), [0.0; 3]);
    }

    #[test]
    fn shares_sum_to_one() {
        for shares in [
            [1.0, 0.0, 0.0, 0.0],
            [0.25; 4],
            [0.4, 0.3, 0.2, 0.1],
            [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.0],
        ] {
            let steps = pack_shares(shares);
            assert_eq!(
                steps.iter().map(|step| u32::from(*step)).sum::<u32>(),
                255,
                "{shares:?}"
            );
        }
    }

    #[test]
    fn metres_have_a_limit() {
        let packed = pack_metres(&[-1.23456, 1.7]).expect("fits");
        let back = unpack_metres(&packed);
        assert!((back[0] + 1.2346).abs() < 1e-6 && (back[1] - 1.7).abs() < 1e-6);
        assert!(pack_metres(&[3.3]).is_none() && pack_metres(&[f32::NAN]).is_none());
    }
}
