"""The renderer: from bodies, poses and an appearance to labels and a picture. The only folder that imports warp.

The pipeline in order. Modules marked * are kernels; each is launched by the host's module named above it.

    device         Warp, set up so that every machine computes the same bytes
    compiled       compiled kernels, checked by digest when they are loaded
    renderer       one scene's door: `observe` a pose once, then `shade` it in each weather
    geometry       all bodies' triangles, on the device
    view           a pose and a camera, as the numbers that kernels are given

    observe        from a pose to an Observation, all labels of a frame
    visibility*    which triangle every sample sees
    observation*   depth, instance, semantic, boxes and counts from that

    picture        from an Observation and an appearance to a picture
    samples*       the points that are shaded, and the geometry at each
    images*        images on surfaces, by the footprint of a pixel; album, their mip levels, on the host
    pattern*       what a surface looks like close by: detail*, grounds*, walls*, panes*, prints*
    skylight       the clear sky by the sun's altitude, on the host
    atmosphere     weather and sun as numbers of light, on the host
    colours        a look as every surface's colours, on the host
    sunlight       when shadow maps are made, and about what
    shadow*        what stands between a point and the sun
    lamps          which lamps burn and which bodies stand near the ground, on the host
    nearby*        which of them reach a tile of the picture
    glow*          lamps' light in fog
    air*           the sky, and what fog does to light on its way
    recall*        what of an earlier frame's light must be asked again
    matter*        what a surface is made of at a point, wet or dry
    shade*         the light that leaves each sample towards the eye
    reflection*    what wet ground mirrors of it
    rain*          drops before the camera
    camera*        samples into pixels, exposure, tone, noise, 8 bits
    exposure       a camera's settings as gains and tables, on the host
    film           what of a picture takes more than that, on the host: by way of a plate of light
    blur*          what moves while the shutter is open
    bloom*         light that bright places shed
    lens*          which place of the plate each pixel shows, in labels and in colour

For many frames of one camera on a GPU:

    reel           the frames' numbers, made ahead, in a block of memory each
    lane           all kernels of a frame, recorded and replayed
    bands*         large triangles shared out
    slots*         places for samples that nobody counts

Everywhere: bounds*, vectors* and noise*, arithmetic in an order that is ours; timing, seconds by stage.
"""

from recipe_runtime.render.observe import ObjectView, Observation
from recipe_runtime.render.renderer import Renderer

__all__ = ["ObjectView", "Observation", "Renderer"]
