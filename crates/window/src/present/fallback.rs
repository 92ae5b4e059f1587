//! Falls back to drawing on the CPU when the GPU fails.

use super::soft::Painter;
use super::{Controls, Drawing, PresentError, Presenter};
use bokehcam::compute::DevicePicture;
use bokehcam::compute::with_fallback::WithFallback;

/// Presents with a GPU, and after its first error with another presenter.
pub struct FallbackPresenter<CreateFallback> {
    /// The GPU presenter with its spare: a constructor, and a painter that always has the current controls.
    presenter: WithFallback<Box<dyn Presenter>, (CreateFallback, Painter)>,
    size: (u32, u32),
}

impl<CreateFallback: FnOnce(Painter) -> Result<Box<dyn Presenter>, PresentError>> FallbackPresenter<CreateFallback> {
    /// Creates a presenter that uses `first`, and after it fails the one that `create_fallback` creates.
    pub fn new(first: Box<dyn Presenter>, create_fallback: CreateFallback) -> Self {
        Self { presenter: WithFallback::new(first, (create_fallback, Painter::new())), size: (0, 0) }
    }
}

impl<CreateFallback: FnOnce(Painter) -> Result<Box<dyn Presenter>, PresentError>> Presenter
    for FallbackPresenter<CreateFallback>
{
    fn resize(&mut self, size: (u32, u32)) {
        self.size = size;
        self.presenter.worker_mut().resize(size);
    }

    fn set_controls(&mut self, controls: Controls) {
        if let Some((_, painter)) = self.presenter.fallback_mut() {
            painter.set_controls(controls.clone());
        }
        self.presenter.worker_mut().set_controls(controls);
    }

    fn present(&mut self, drawing: &Drawing) -> Result<(), PresentError> {
        let Self { presenter, size } = self;
        let make = |_: &mut _, (create_fallback, painter): (CreateFallback, Painter)| {
            let mut soft = create_fallback(painter)?;
            soft.resize(*size);
            Ok(soft)
        };
        presenter.run("draws", |presenter| presenter.present(drawing), make)
    }

    fn supports(&self, picture: &DevicePicture) -> bool {
        self.presenter.worker().supports(picture)
    }

    fn uses_gpu(&self) -> bool {
        self.presenter.worker().uses_gpu()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use egui::epaint::{ClippedPrimitive, Color32, ColorImage, ImageDelta, Mesh, Primitive, textures::TexturesDelta};
    use egui::{Pos2, Rect, TextureId, TextureOptions};

    use super::*;
    use crate::present::{Area, Image};
    use bokehcam::frame;

    const SIZE: (u32, u32) = (64, 48);
    const PIXELS: usize = (SIZE.0 * SIZE.1) as usize;

    /// Fails after this number of frames.
    struct Gpu(u32);

    impl Presenter for Gpu {
        fn resize(&mut self, _: (u32, u32)) {}
        fn set_controls(&mut self, mut controls: Controls) {
            controls.textures.clear();
        }
        fn present(&mut self, _: &Drawing) -> Result<(), PresentError> {
            self.0 = self.0.checked_sub(1).ok_or_else(|| PresentError("device lost".to_owned()))?;
            Ok(())
        }
        fn uses_gpu(&self) -> bool {
            true
        }
    }

    type Screen = Rc<RefCell<Vec<u32>>>;

    struct Soft(Painter, Screen);

    impl Presenter for Soft {
        fn resize(&mut self, size: (u32, u32)) {
            self.0.resize(size);
        }
        fn set_controls(&mut self, controls: Controls) {
            self.0.set_controls(controls);
        }
        fn present(&mut self, drawing: &Drawing) -> Result<(), PresentError> {
            self.0.paint(&mut self.1.borrow_mut(), drawing);
            Ok(())
        }
    }

    /// Controls with a texture that is set once, and later only used.
    fn controls(with_texture: bool, left_px: f32) -> Controls {
        let id = TextureId::Managed(7);
        let mut textures = TexturesDelta::default();
        if with_texture {
            let image = ColorImage::filled([2, 2], Color32::from_rgb(200, 30, 90));
            textures.push(id, ImageDelta::full(image, TextureOptions::NEAREST));
        }
        let mut mesh = Mesh::with_texture(id);
        let rect = Rect::from_min_max(Pos2::new(left_px, 4.0), Pos2::new(left_px + 20.0, 30.0));
        mesh.add_rect_with_uv(rect, Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0)), Color32::WHITE);
        let clip_rect = Rect::from_min_max(Pos2::ZERO, Pos2::new(SIZE.0 as f32, SIZE.1 as f32));
        let primitives = vec![ClippedPrimitive { clip_rect, primitive: Primitive::Mesh(mesh) }];
        Controls { primitives, textures, pixels_per_point: 1.0 }
    }

    #[test]
    fn what_was_set_before_the_gpu_failed_is_shown_after() {
        let mut picture = frame::ColorImage::new(SIZE.0, SIZE.1);
        picture.rgb.iter_mut().enumerate().for_each(|(k, value)| *value = k as u8);
        let drawing = Drawing {
            area: Area { x: 0, y: 0, width: SIZE.0, height: SIZE.1 },
            picture: Image::Memory(&picture),
            visible_region: None,
            before: None,
            mirror: false,
            stale: false,
            background: [9; 3],
        };
        let expected: Screen = Rc::new(RefCell::new(vec![0; PIXELS]));
        let mut painter = Soft(Painter::new(), Rc::clone(&expected));
        let shown: Screen = Rc::new(RefCell::new(vec![0; PIXELS]));
        let screen = Rc::clone(&shown);
        let other = move |painter| Ok(Box::new(Soft(painter, screen)) as Box<dyn Presenter>);
        let mut fallback = FallbackPresenter::new(Box::new(Gpu(2)), other);
        for presenter in [&mut painter as &mut dyn Presenter, &mut fallback] {
            presenter.resize(SIZE);
            presenter.set_controls(controls(true, 8.0));
            presenter.present(&drawing).unwrap();
            presenter.set_controls(controls(false, 30.0));
            presenter.present(&drawing).unwrap();
        }
        assert!(fallback.uses_gpu() && *shown.borrow() == [0; PIXELS]);
        fallback.present(&drawing).unwrap();
        assert!(!fallback.uses_gpu());
        assert_eq!(*shown.borrow(), *expected.borrow(), "controls and picture");
        assert!(expected.borrow().contains(&0x00c8_1e5a), "with the controls");
        fallback.present(&drawing).unwrap();
    }
}
