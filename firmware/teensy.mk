# The three Teensy images with the plain Arm compiler, from PJRC's cores: what PlatformIO builds, without it.
#   make -f teensy.mk TEENSY_CORES=PATH       build/teensy/{teensy35,teensy41,teensy41-grasper}.elf
# PATH is a folder or an archive with cores/teensy3, cores/teensy4 (PaulStoffregen/cores) and QuadEncoder
# (mjs513/Teensy-4.x-Quad-Encoder-Library). Flags are those of PlatformIO's platform-teensy.
ARM_PREFIX ?= arm-none-eabi-
BUILD      ?= build
TEENSY     := $(BUILD)/teensy
IMAGES     := teensy35 teensy41 teensy41-grasper

.PHONY: all
all: $(IMAGES:%=$(TEENSY)/%.elf)

# an archive is unpacked once
ifneq ($(wildcard $(TEENSY_CORES)/.),)
FROM := $(TEENSY_CORES)
else
FROM := $(TEENSY)/source
UNPACKED := $(shell mkdir -p $(FROM) && [ -d $(FROM)/cores ] || tar -xf '$(TEENSY_CORES)' -C $(FROM))
endif

GENERAL := -O2 -Wall -ffunction-sections -fdata-sections -mthumb -nostdlib -DUSB_SERIAL -DARDUINO=10805 \
           -DTEENSYDUINO=162 -DCORE_TEENSY -DLAYOUT_US_ENGLISH
CPP     := -std=gnu++17 -fno-exceptions -felide-constructors -fno-rtti -fno-threadsafe-statics \
           -fpermissive -Wno-psabi
OWN     := -Wextra -Werror -ffp-contract=off $(shell python3 build_hash.py)
SOURCES := $(wildcard core/*.hpp boards/*.hpp boards/teensy/*)

teensy3_CPU := -mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16 -mno-unaligned-access \
               -fsingle-precision-constant
teensy3_FOR := -DF_CPU=120000000L -D__MK64FX512__ -DARDUINO_TEENSY35
teensy3_LD  := mk64fx512.ld
teensy4_CPU := -mcpu=cortex-m7 -mfloat-abi=hard -mfpu=fpv5-d16
teensy4_FOR := -DF_CPU=600000000 -D__IMXRT1062__ -DARDUINO_TEENSY41
teensy4_LD  := imxrt1062_t41.ld

# $(1) is the core's folder: its objects and the encoder library's
define core_rules
$(1)_FLAGS := $(GENERAL) $$($(1)_CPU) $$($(1)_FOR) -isystem $(FROM)/cores/$(1) -isystem $(FROM)/QuadEncoder
$(1)_C     := $$(wildcard $(FROM)/cores/$(1)/*.c $(FROM)/cores/$(1)/*.S $(FROM)/cores/$(1)/*.cpp)
$(1)_O     := $$(patsubst $(FROM)/cores/$(1)/%,$(TEENSY)/$(1)/%.o,$$($(1)_C))

$(TEENSY)/$(1)/%.c.o: $(FROM)/cores/$(1)/%.c
	@mkdir -p $$(@D)
	@$(ARM_PREFIX)gcc $$($(1)_FLAGS) -w -c $$< -o $$@
$(TEENSY)/$(1)/%.S.o: $(FROM)/cores/$(1)/%.S
	@mkdir -p $$(@D)
	@$(ARM_PREFIX)gcc -x assembler-with-cpp $$($(1)_FLAGS) -w -c $$< -o $$@
$(TEENSY)/$(1)/%.cpp.o: $(FROM)/cores/$(1)/%.cpp
	@mkdir -p $$(@D)
	@$(ARM_PREFIX)g++ $$($(1)_FLAGS) $(CPP) -w -c $$< -o $$@
$(TEENSY)/$(1)/QuadEncoder.o: $(FROM)/QuadEncoder/QuadEncoder.cpp
	@mkdir -p $$(@D)
	@$(ARM_PREFIX)g++ $$($(1)_FLAGS) $(CPP) -w -c $$< -o $$@
$(TEENSY)/$(1)/core.a: $$($(1)_O)
	@rm -f $$@
	@$(ARM_PREFIX)gcc-ar rcs $$@ $$^
endef
$(foreach core,teensy3 teensy4,$(eval $(call core_rules,$(core))))

# $(1) image, $(2) core, $(3) further flags of the compiler and the linker, $(4) further objects
define image_rule
$(TEENSY)/$(1).elf: $(SOURCES) $(4) $(TEENSY)/$(2)/core.a teensy.mk
	$(ARM_PREFIX)g++ $$($(2)_FLAGS) $(CPP) $(OWN) $(3) -c boards/teensy/main.cpp -o $(TEENSY)/$(1).o
	$(ARM_PREFIX)g++ -O2 -Wl,--gc-sections,--relax -mthumb $$($(2)_CPU) $(3) -Wl,--defsym=__rtc_localtime=0 \
	    -T$(FROM)/cores/$(2)/$$($(2)_LD) -o $$@ $(TEENSY)/$(1).o $(4) $(TEENSY)/$(2)/core.a -lm -lstdc++
	@$(ARM_PREFIX)size $$@
endef

# the emulator has no floating-point unit for doubles: the same images with them in software
EMULATED := $(IMAGES:%=$(TEENSY)/%.emulated.elf)
SOFT     := -mfpu=fpv4-sp-d16
.PHONY: emulated
emulated: $(EMULATED)

$(eval $(call image_rule,teensy35.emulated,teensy3,,))
$(eval $(call image_rule,teensy41.emulated,teensy4,$(SOFT),$(TEENSY)/teensy4/QuadEncoder.o))
$(eval $(call image_rule,teensy41-grasper.emulated,teensy4,-DRIG_GRASPER $(SOFT),$(TEENSY)/teensy4/QuadEncoder.o))
$(eval $(call image_rule,teensy35,teensy3,,))
$(eval $(call image_rule,teensy41,teensy4,,$(TEENSY)/teensy4/QuadEncoder.o))
$(eval $(call image_rule,teensy41-grasper,teensy4,-DRIG_GRASPER,$(TEENSY)/teensy4/QuadEncoder.o))
