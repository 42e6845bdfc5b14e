//! The points whose depth is found.

/// Points per frame.
pub const COUNT: usize = 21;
/// Bones per frame.
pub const BONE_COUNT: usize = 23;

/// The points' indices among BlazePose's: nose, ears, shoulders, elbows, wrists, first knuckles of the index fingers, hips, knees,
/// ankles, heels and toes, left before right.
pub const BLAZE: [usize; COUNT] = [
    0, 7, 8, 11, 12, 13, 14, 15, 16, 19, 20, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32,
];
/// The places of the hips, whose middle has the depth 0.
pub const HIPS: [usize; 2] = [11, 12];
/// Pairs of places whose difference in depth is a bone's.
pub const BONES: [[usize; 2]; BONE_COUNT] = [
    [11, 13],
    [12, 14],
    [13, 15],
    [14, 16],
    [15, 19],
    [16, 20],
    [17, 19],
    [18, 20],
    [11, 3],
    [12, 4],
    [3, 5],
    [4, 6],
    [5, 7],
    [6, 8],
    [7, 9],
    [8, 10],
    [1, 0],
    [2, 0],
    [3, 1],
    [4, 2],
    [12, 11],
    [4, 3],
    [2, 1],
];

/// The place on the body's other side.
pub fn mirrored(place: usize) -> usize {
    match place {
        0 => 0,
        odd if odd % 2 == 1 => odd + 1,
        even => even - 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::KeyPointSet;

    #[test]
    fn places_and_their_mirrors_are_those_of_the_key_points() {
        let sides = KeyPointSet::BlazePose33.other_sides();
        for place in 0..COUNT {
            assert_eq!(BLAZE[mirrored(place)], sides[BLAZE[place]], "{place}");
            assert_eq!(mirrored(mirrored(place)), place);
        }
    }
}
