//! The GPU executor encodes YUYV for sinks that are cameras.
#![allow(missing_docs)]

use crate::common;

use bokehcam::bokeh::cpu::BandedBokeh;
use bokehcam::bokeh::gpu::GpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::{Bokeh, Job};
use bokehcam::compute::PictureLocation;
use bokehcam::frame::YuyvImage;
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocKind;
use bokehcam_live::sink::yuyv;
use common::{coc, noise, settings, three_depths};

/// Returns the picture encoded as YUYV, to the bit, where YUYV is allowed and possible; elsewhere the picture.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn yuyv_is_the_picture_encoded() {
    for (width, height, is_even) in
        [(64, 48, true), (130, 7, true), (258, 3, true), (2, 1, true), (97, 71, false), (1, 1, false)]
    {
        let field = coc(CocKind::Depth, height);
        let plan = Plan::new(&settings(CocKind::Depth), width, height);
        let mut gpu = GpuBokeh::new(&plan, false, None).expect("a Vulkan adapter, software included");
        let mut cpu = BandedBokeh::new(plan, Some(1));
        let (image, map) = (noise(width, height), three_depths(width, height));
        let job = |place, yuyv: bool| Job {
            place,
            yuyv: yuyv.then(|| Pooled::detached(YuyvImage::default())),
            ..Job::new(Pooled::detached(image.clone()), Some(Pooled::detached(map.clone())), field)
        };
        let made = |bokeh: &mut dyn Bokeh, job: Job| {
            bokeh.submit(job).expect("room for a frame");
            bokeh.collect(true).expect("a frame").expect("one is in flight").picture
        };
        let expected = made(&mut gpu, job(PictureLocation::Memory, false)).memory().expect("in memory").clone();
        let mut bytes = vec![0; 2 * (width * height) as usize];
        if is_even {
            yuyv::Encoder::new().encode(&expected, &mut bytes);
        }
        // Twice, with other pictures in between.
        for _ in 0..2 {
            let mut picture = made(&mut gpu, job(PictureLocation::Memory, true));
            assert_eq!(picture.yuyv_mut().is_some(), is_even);
            assert_eq!((picture.size(), picture.memory().is_some()), ((width, height), !is_even));
            if let Some(yuyv) = picture.yuyv_mut() {
                assert_eq!(yuyv.size(), (width, height));
                assert!(yuyv.bytes == bytes, "{width} x {height}");
            }
            for picture in
                [made(&mut gpu, job(PictureLocation::Both, true)), made(&mut gpu, job(PictureLocation::Memory, false))]
            {
                assert!(picture.memory() == Some(&expected), "{width} x {height}");
            }
        }
        let mut picture = made(&mut cpu, job(PictureLocation::Memory, true));
        assert!(picture.memory().is_some() && picture.yuyv_mut().is_none(), "the CPU makes pictures");
    }
}
