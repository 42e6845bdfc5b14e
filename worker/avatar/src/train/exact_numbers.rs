//! Numbers in `state.json` that are read back as they were. serde_json writes the shortest text of a number but
//! reads texts of more than 15 digits up to a unit in the last place beside it. A checkpoint that is read and written
//! again would then move everybody's joints a little, and with them their pictures.

use super::checkpoint::ModelState;

/// Units in the last place around a number where one is whose text is read as that number.
const NEAR: [i64; 9] = [0, 1, -1, 2, -2, 3, -3, 4, -4];

/// `state` with numbers in place of those of its skeletons and its progress that are read back as these.
pub(super) fn written(mut state: ModelState) -> ModelState {
    let joints = state.slots.iter_mut().flatten();
    let numbers = joints.flat_map(|skeleton| skeleton.rest.iter_mut().flatten());
    numbers.for_each(|number| *number = whose_text_is_read_as(*number));
    state.progress = whose_text_is_read_as(state.progress);
    state
}

/// A number whose text is read as `number`; itself if there is none nearby.
fn whose_text_is_read_as(number: f64) -> f64 {
    let read = |it: &f64| -> Option<f64> {
        let text = serde_json::to_string(it).ok()?;
        serde_json::from_str(&text).ok()
    };
    let near = NEAR.map(|units| f64::from_bits(number.to_bits().wrapping_add_signed(units)));
    let found = near.into_iter().find(|it| read(it) == Some(number));
    found.unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn what_is_written_is_read_exactly() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut moved = 0;
        for _ in 0..20_000 {
            let number: f64 = rng.random_range(-2.0..2.0);
            let read = |it: f64| -> f64 {
                let text = serde_json::to_string(&it).expect("a number");
                serde_json::from_str(&text).expect("a number")
            };
            assert_eq!(read(whose_text_is_read_as(number)), number);
            moved += u32::from(read(number) != number);
        }
        assert!(moved > 0, "serde_json reads exactly: this module can go");
        assert_eq!(whose_text_is_read_as(0.0), 0.0);
    }
}
