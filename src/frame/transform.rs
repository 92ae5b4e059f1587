//! Turns, flips and cuts pictures, and the maps and masks that belong to them.

use std::fmt;
use std::str::FromStr;

use super::{ColorImage, DepthMap, Mask};
use crate::names::named;

named! {
    /// A clockwise rotation.
    pub enum Rotation default None {
        /// As the camera delivers it
        None = "0",
        /// A quarter turn clockwise
        Quarter = "90",
        /// Upside down
        Half = "180",
        /// A quarter turn anticlockwise
        ThreeQuarters = "270",
    }
}

named! {
    /// A reflection.
    pub enum Flip default None {
        /// As the camera delivers it
        None = "none",
        /// Left and right are swapped
        Horizontal = "horizontal",
        /// Top and bottom are swapped
        Vertical = "vertical",
    }
}

/// A part of a picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Width, at least 1.
    pub width: u32,
    /// Height, at least 1.
    pub height: u32,
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
}

impl FromStr for Area {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = || {
            let (size, place) = text.split_once('+')?;
            let ((width, height), (x, y)) = (size.split_once(['x', 'X'])?, place.split_once('+')?);
            let number = |text: &str| text.bytes().all(|c| c.is_ascii_digit()).then(|| text.parse().ok())?;
            let area = Self { width: number(width)?, height: number(height)?, x: number(x)?, y: number(y)? };
            (area.width > 0 && area.height > 0).then_some(area)
        };
        parse().ok_or_else(|| "use WIDTHxHEIGHT+X+Y in pixels, such as 1280x720+320+180".to_owned())
    }
}

impl fmt::Display for Area {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, x, y } = self;
        write!(f, "{width}x{height}+{x}+{y}")
    }
}

/// Rotates a picture clockwise, then flips it, then cuts an area out of the result. The default changes nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transform {
    /// The rotation.
    pub rotation: Rotation,
    /// The reflection of the rotated picture.
    pub flip: Flip,
    /// The area to keep, in pixels of the rotated picture; `None` keeps all.
    pub area: Option<Area>,
}

/// Side of the square tiles in which rows become columns, in pixels: source and destination stay in the cache.
const TILE_PX: usize = 64;

impl Transform {
    /// Returns whether pictures stay as they are.
    pub fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the size of a picture of `size` once it is rotated.
    pub fn rotated_size(&self, (width, height): (u32, u32)) -> (u32, u32) {
        match self.rotation {
            Rotation::None | Rotation::Half => (width, height),
            Rotation::Quarter | Rotation::ThreeQuarters => (height, width),
        }
    }

    /// Returns the area of the rotated picture that is kept; `None` if it lies outside of pictures of `size`.
    fn area_in(&self, size: (u32, u32)) -> Option<Area> {
        let (width, height) = self.rotated_size(size);
        let area = self.area.unwrap_or(Area { width, height, x: 0, y: 0 });
        let is_within = |begin: u32, length: u32, side: u32| begin.checked_add(length).is_some_and(|end| end <= side);
        (is_within(area.x, area.width, width) && is_within(area.y, area.height, height)).then_some(area)
    }

    /// Returns the size of pictures after the transform, from their `size` before.
    ///
    /// # Errors
    /// The area is not within them; returns their size once they are rotated.
    pub fn output_size(&self, size: (u32, u32)) -> Result<(u32, u32), (u32, u32)> {
        self.area_in(size).map(|area| (area.width, area.height)).ok_or(self.rotated_size(size))
    }

    /// Writes the transformed picture to `into`, whose memory is reused. The area must be within the picture.
    pub fn apply_to_color(&self, from: &ColorImage, into: &mut ColorImage) {
        let Some(area) = self.area_in(from.size()) else { return };
        into.resize(area.width, area.height);
        self.transform(from.rgb.as_chunks::<3>().0, from.size(), area, into.rgb.as_chunks_mut::<3>().0);
    }

    /// Returns the transformed picture. The area must be within it.
    pub fn transform_color(&self, color: ColorImage) -> ColorImage {
        if self.is_identity() {
            return color;
        }
        let mut into = ColorImage::default();
        self.apply_to_color(&color, &mut into);
        into
    }

    /// Returns the transformed pixels of a picture of `size`. The area must be within the picture.
    pub fn apply_to_pixels<T: Copy + Default>(&self, from: &[T], size: (u32, u32)) -> Vec<T> {
        let Some(area) = self.area_in(size) else { return Vec::new() };
        let mut into = vec![T::default(); area.width as usize * area.height as usize];
        self.transform(from, size, area, &mut into);
        into
    }

    /// Writes the transformed depth map of a picture of `picture_px` to `into`, whose memory is reused. The map may have
    /// another resolution than the picture; it has no matte yet.
    pub fn apply_to_map(&self, from: &DepthMap, picture_px: (u32, u32), into: &mut DepthMap) {
        let area = self.area_on(from.size(), picture_px);
        into.resize(area.width, area.height);
        self.transform(&from.metres, from.size(), area, &mut into.metres);
        into.matte.pixels.clear();
        (into.subject_m, into.person_m, into.is_smooth) = (from.subject_m, from.person_m, from.is_smooth);
    }

    /// Returns the transformed depth map of a picture of `picture_px` ([`Transform::apply_to_map`]).
    pub fn transform_map(&self, map: DepthMap, picture_px: (u32, u32)) -> DepthMap {
        if self.is_identity() {
            return map;
        }
        let mut into = DepthMap::default();
        self.apply_to_map(&map, picture_px, &mut into);
        into
    }

    /// Returns the transformed mask of a picture of `picture_px`; it may have another resolution than the picture.
    pub fn apply_to_mask(&self, from: &Mask, picture_px: (u32, u32)) -> Mask {
        let (size, mut into) = ((from.width, from.height), Mask::default());
        let area = self.area_on(size, picture_px);
        into.resize(area.width, area.height);
        self.transform(&from.alpha, size, area, &mut into.alpha);
        into
    }

    /// Returns where a point of a picture of `picture_px` is after the transform, both in fractions of width and height;
    /// `None` outside of the area.
    pub fn apply_to_point(&self, [x, y]: [f32; 2], picture_px: (u32, u32)) -> Option<[f32; 2]> {
        let [x, y] = match self.rotation {
            Rotation::None => [x, y],
            Rotation::Quarter => [1.0 - y, x],
            Rotation::Half => [1.0 - x, 1.0 - y],
            Rotation::ThreeQuarters => [y, 1.0 - x],
        };
        let [x, y] = match self.flip {
            Flip::None => [x, y],
            Flip::Horizontal => [1.0 - x, y],
            Flip::Vertical => [x, 1.0 - y],
        };
        let (area, (width, height)) = (self.area_in(picture_px)?, self.rotated_size(picture_px));
        let point = [(x, width, area.x, area.width), (y, height, area.y, area.height)]
            .map(|(at, side, begin, length)| (at * side as f32 - begin as f32) / length as f32);
        point.iter().all(|at| (0.0..=1.0).contains(at)).then_some(point)
    }

    /// Returns the area on a rotated map of `size` that belongs to a picture of `picture_px`, to the nearest pixel.
    fn area_on(&self, size: (u32, u32), picture_px: (u32, u32)) -> Area {
        let ((width, height), (picture_width, picture_height)) =
            (self.rotated_size(size), self.rotated_size(picture_px));
        let Some(area) = self.area else { return Area { width, height, x: 0, y: 0 } };
        let scaled = |begin: u32, length: u32, side: u32, picture_side: u32| {
            let scale = |at: u32| (f64::from(at) * f64::from(side) / f64::from(picture_side.max(1))).round() as u32;
            let begin = scale(begin).min(side.saturating_sub(1));
            (begin, scale(length).clamp(1, side.saturating_sub(begin).max(1)))
        };
        let (x, width) = scaled(area.x, area.width, width, picture_width);
        let (y, height) = scaled(area.y, area.height, height, picture_height);
        Area { width, height, x, y }
    }

    /// Writes the `area` of the rotated samples to `into`, which has as many: one pass, in tiles where rows become columns.
    fn transform<T: Copy>(&self, from: &[T], size: (u32, u32), area: Area, into: &mut [T]) {
        let (width, height) = (area.width as usize, area.height as usize);
        if from.is_empty() || into.is_empty() {
            return;
        }
        let (first, step_x, step_y) = self.steps(size, area);
        let at = |x: usize, y: usize| (first + step_x * x as isize + step_y * y as isize) as usize;
        match step_x {
            1 => {
                for (y, row) in into.chunks_exact_mut(width).enumerate() {
                    let begin = at(0, y);
                    row.copy_from_slice(&from[begin..begin + width]);
                }
            }
            -1 => {
                for (y, row) in into.chunks_exact_mut(width).enumerate() {
                    let end = at(0, y) + 1;
                    let reversed = from[end - width..end].iter().rev();
                    row.iter_mut().zip(reversed).for_each(|(into, from)| *into = *from);
                }
            }
            _ => {
                for top in (0..height).step_by(TILE_PX) {
                    for left in (0..width).step_by(TILE_PX) {
                        let right = (left + TILE_PX).min(width);
                        for y in top..(top + TILE_PX).min(height) {
                            let row = &mut into[y * width + left..y * width + right];
                            row.iter_mut().enumerate().for_each(|(x, into)| *into = from[at(left + x, y)]);
                        }
                    }
                }
            }
        }
    }

    /// Returns the index of the area's first sample in a plane of `size`, and the steps to the next column and row.
    fn steps(&self, size: (u32, u32), area: Area) -> (isize, isize, isize) {
        let (width, height) = (size.0 as isize, size.1 as isize);
        let index = |x: isize, y: isize| {
            let (x, y) = (x + area.x as isize, y + area.y as isize);
            let (rotated_width, rotated_height) = self.rotated_size(size);
            let (x, y) = match self.flip {
                Flip::None => (x, y),
                Flip::Horizontal => (rotated_width as isize - 1 - x, y),
                Flip::Vertical => (x, rotated_height as isize - 1 - y),
            };
            let (x, y) = match self.rotation {
                Rotation::None => (x, y),
                Rotation::Quarter => (y, height - 1 - x),
                Rotation::Half => (width - 1 - x, height - 1 - y),
                Rotation::ThreeQuarters => (width - 1 - y, x),
            };
            y * width + x
        };
        let first = index(0, 0);
        (first, index(1, 0) - first, index(0, 1) - first)
    }
}

#[cfg(test)]
mod tests;
