//! How the pictures of a render are divided among workers.

/// Most ranges of a render: each costs a worker one call.
const MOST: u32 = 64;
/// Fewest pictures of a range, except the last one: drawing a picture of splats takes less time than the call.
const SHORTEST: u32 = 4;

/// The first picture and the length of each range, in order. The ranges cover all `pictures`, each once.
pub fn split(pictures: u32) -> impl Iterator<Item = (u32, u32)> {
    let length = pictures.div_ceil(MOST).max(SHORTEST);
    let starts = (0..pictures).step_by(length as usize);
    starts.map(move |first| (first, length.min(pictures - first)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_have_every_picture_once() {
        for pictures in [0, 1, 4, 5, 63, 64, 255, 256, 257, 1000, 100_001] {
            let all: Vec<u32> = split(pictures)
                .flat_map(|(first, count)| first..first + count)
                .collect();
            assert_eq!(all, (0..pictures).collect::<Vec<_>>());
            assert!(split(pictures).count() <= MOST as usize);
        }
        assert_eq!(split(10).collect::<Vec<_>>(), [(0, 4), (4, 4), (8, 2)]);
    }
}
